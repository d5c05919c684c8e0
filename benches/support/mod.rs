//! Figures of a run as a CSV file, and the charts that are drawn from it.
//!
//! A bench measures, writes `benches/charts/NAME.csv` and draws `NAME.svg` from that file. With `-- --redraw` it only
//! draws.

#![allow(dead_code, reason = "each bench uses a part")]

pub mod log_axis;
pub mod scatter;

use std::error::Error;
use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::available_parallelism;

use hexad::output::files::write_whole;
use serde::de::DeserializeOwned;

/// Anything that ends a bench.
pub type Failure = Box<dyn Error + Send + Sync>;

/// Path of a file in `benches/charts`.
pub fn chart(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/charts").join(name)
}

/// Date, commit, processor and compiler of a run, as one line.
pub fn provenance() -> String {
    let output = |program: &str, arguments: &[&str]| {
        let output = Command::new(program).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
        let output = output.ok().filter(|output| output.status.success());
        output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let unknown = |what: &str| format!("unknown {what}");
    let date = output("date", &["-u", "+%F"]).unwrap_or_else(|| unknown("date"));
    let commit = output("git", &["rev-parse", "--short", "HEAD"]).unwrap_or_else(|| unknown("commit"));
    // The charts of the benches before this one are no change of the code.
    let changes = output("git", &["status", "--porcelain", "--", ".", ":!benches/charts"]);
    let changed = if changes.is_none_or(|changes| changes.is_empty()) { "" } else { " with changes" };
    let compiler = output("rustc", &["--version"]).unwrap_or_else(|| unknown("compiler"));
    let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let model = model.map_or_else(|| unknown("processor"), |(_, model)| model.trim().to_owned());
    let processors = available_parallelism().map_or(0, usize::from);
    format!("{date}, {commit}{changed}, {processors} x {model}, {compiler}")
}

/// Writes a CSV file; its first line is a comment, the provenance.
pub fn write_csv<R>(name: &str, header: &[&str], rows: impl IntoIterator<Item = R>) -> Result<(), Failure>
where
    R: IntoIterator<Item: AsRef<[u8]>>,
{
    let mut csv = csv::Writer::from_writer(format!("# {}\n", provenance()).into_bytes());
    csv.write_record(header)?;
    for row in rows {
        csv.write_record(row)?;
    }
    let path = chart(name);
    fs::create_dir_all(chart(""))?;
    write_whole(&path, &csv.into_inner()?)?;
    println!("written: {}", path.display());
    Ok(())
}

/// Figures of a run, read back from their file.
pub struct Figures<T> {
    provenance: Option<String>,
    pub rows: Vec<T>,
}

impl<T: DeserializeOwned> Figures<T> {
    /// Rows of `benches/charts/NAME`; fields are found by the names of their columns.
    pub fn read(name: &str) -> Result<Self, Failure> {
        let text = fs::read_to_string(chart(name)).map_err(|error| format!("{name}: {error}"))?;
        let provenance = text.lines().next().and_then(|line| line.strip_prefix("# ")).map(String::from);
        let mut csv = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        Ok(Self { provenance, rows: csv.deserialize().collect::<Result<_, _>>()? })
    }

    /// A title with the provenance as its subtitle.
    pub fn titled(&self, title: &str) -> String {
        let lines: Vec<_> = [title].into_iter().chain(self.provenance.as_deref()).collect();
        lines.join("\n")
    }
}

/// Cells of a row.
pub fn cells<const N: usize>(cells: [&dyn Display; N]) -> Vec<String> {
    cells.map(ToString::to_string).into()
}
