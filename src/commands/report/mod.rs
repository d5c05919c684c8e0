//! `hexad report`: a recording as one page with charts, which any browser opens from disk.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;

use self::levels::{Extent, Level};
use self::run::Run;
use self::summary::{date_and_time, facts, plain_text};
use super::failure::{CommandError, Failure};
use crate::output::page::{PageKind, page};
use hexad_daemon::recording::RecordingError;
use hexad_machine::config::{Config, ConfigError};
use hexad_machine::text::files::{FileError, print, write_whole};

pub mod deadlines;
pub mod head;
pub mod history;
pub mod levels;
pub mod list;
pub mod references;
pub mod run;
pub mod signals;
pub mod summary;
pub mod track;

/// Bound on the samples of a page \[bytes\]; as text they take a third more. Such a page fits into an e-mail,
/// and a browser decodes it in a tenth of a second.
const MAX_SAMPLE_BYTES: usize = 12_000_000;

#[derive(Debug, Args)]
pub struct ReportArguments {
    /// Recordings of one run of `hexad run --record` or `--faults`, one or more
    #[arg(value_name = "FILE", required = true)]
    recordings: Vec<PathBuf>,
    /// Page to write
    #[arg(long, short, value_name = "FILE", default_value = "report.html")]
    output: PathBuf,
}

/// Error of a report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{}: of another run than {}; report each run alone", .0.display(), .1.display())]
    OtherRun(PathBuf, PathBuf),
}

impl CommandError for ReportError {}

impl ReportArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let words = write(&self.recordings, &self.output)?;
        Ok(print(format_args!("{}: {words}\n", self.output.display()))?)
    }
}

/// Writes the page of a run from its files. Returns a description of the content.
pub fn write(recordings: &[PathBuf], output: &Path) -> Result<String, ReportError> {
    let run = Run::read(recordings)?;
    let levels = run.levels(MAX_SAMPLE_BYTES)?;
    let extents: Vec<Extent> = levels.iter().map(|level| level.extent).collect();
    let kept = kept(&extents, run.history.span(), run.config());
    let samples: Vec<u8> = levels.iter().flat_map(Level::bytes).collect();
    let head = head::of_recording(&run, &extents, &kept);
    let ending = if run.history.is_unfinished { ", unfinished" } else { "" };
    let title = format!("{}: recording{ending}", run.info().name);
    let begin = date_and_time(run.begin_s());
    let summary = plain_text(&format!("{title}, from {begin}"), &facts(&run));
    let text = page(PageKind::Recording, &title, &summary, &head, &samples);
    write_whole(output, text.as_bytes())?;
    let megabytes = text.len() as f64 * 1e-6;
    Ok(format!("{} cycles, {megabytes:.1} MB; {kept}", run.history.cycles))
}

/// Description of the samples that a page keeps.
fn kept(extents: &[Extent], span: u64, config: &Config) -> String {
    let milliseconds =
        |cycles: u64| (1e6 * config.deployment.realtime.period_s() * cycles as f64).round() * 1e-3;
    let whole = extents.iter().filter(|it| it.first == 0 && it.end() >= span);
    let finest = whole.map(|it| it.step).min().unwrap_or(1);
    let windows = extents.iter().filter(|it| it.step == 1).count();
    match (finest, windows) {
        (1, _) => "every cycle is kept".into(),
        (_, windows) => format!(
            "the smallest and largest value in every {} ms are kept, and every cycle in {windows} windows around \
             faults, the largest tracking error, the latest output and changes of state",
            milliseconds(2 * finest)
        ),
    }
}

/// Recordings in a folder whose names have a prefix, the oldest first.
pub fn recordings_in(folder: &Path, beginning: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return vec![] };
    let names = entries.flatten().map(|entry| entry.path());
    let is_one = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(beginning) && name.ends_with(".mcap")
    };
    let mut found: Vec<_> = names.filter(is_one).collect();
    found.sort();
    found
}
