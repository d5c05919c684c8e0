//! What the benches share: arguments, files of figures and charts, and what could not be measured.
//!
//! A bench measures, writes `benches/charts/NAME.csv` and draws `NAME.svg` from that file. With `-- --redraw` it only
//! draws. With `-- --quick`, and where `cargo bench` does not start it, it exercises every part once within 20 s and leaves
//! `benches/charts` as it is.

#![allow(dead_code, reason = "each bench uses a part")]

pub mod charts;
pub mod log_axis;
pub mod omissions;
pub mod scatter;

use std::error::Error;
use std::fmt::Display;
use std::fs;
use std::process::{Command, ExitCode};
use std::thread::available_parallelism;

use clap::{Args, Parser};

use charts::Charts;

/// Anything that ends a bench.
pub type Failure = Box<dyn Error + Send + Sync>;

/// Arguments of every bench.
#[derive(Args)]
pub struct Extent {
    /// Exercises every part once, within 20 s; changes no file in benches/charts.
    #[arg(long)]
    quick: bool,
    /// What `cargo bench` adds.
    #[arg(long, hide = true)]
    bench: bool,
}

impl Extent {
    /// Whether the run is quick; without `cargo bench` every run is, as its build may be another.
    pub fn is_quick(&self) -> bool {
        self.quick || !self.bench
    }
}

/// Measures, and draws charts of the figures.
#[derive(Parser)]
pub struct ChartArguments {
    #[command(flatten)]
    pub extent: Extent,
    /// Measures nothing and draws the charts from the CSV files.
    #[arg(long, conflicts_with = "quick")]
    pub redraw: bool,
}

impl ChartArguments {
    /// Where the run writes and draws.
    pub fn charts(&self) -> Charts {
        if self.redraw { Charts::published() } else { Charts::of_run(self.extent.is_quick()) }
    }
}

/// Prints the failure that ended a bench, if one did.
pub fn exit_code(outcome: Result<(), Failure>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
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

/// Cells of a row.
pub fn cells<const N: usize>(cells: [&dyn Display; N]) -> Vec<String> {
    cells.map(ToString::to_string).into()
}
