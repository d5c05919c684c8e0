//! `hexad convert`: a recording in another format.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::frame_options::FrameOptions;
use super::quantity::time_within;
use super::report::signals::CycleInstants;
use hexad_daemon::recording::reader::Recording;
use hexad_daemon::recording::table::{TableOrigin, write_csv};
use hexad_daemon::recording::table_choice::{Every, TableChoice};
use hexad_machine::config::Config;
use hexad_machine::text::files::{is_standard, print};
use hexad_machine::text::units::MotionUnits;

#[derive(Debug, Args)]
pub struct ConvertArguments {
    /// Recording of `hexad run --record` or `--faults`
    #[arg(value_name = "FILE")]
    recording: PathBuf,
    /// Write a row for each cycle; `-` is standard output
    #[arg(long, value_name = "FILE")]
    csv: PathBuf,
    /// Write only these columns: names, or beginnings of names before a `_`, as t,reference,measured_length; in the order of the table
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    columns: Vec<String>,
    /// Write a row only for the first cycle of each so many cycles, or of each time with its unit: 10 or 10ms
    #[arg(long, value_name = "CYCLES|TIME", default_value = "1", value_parser = every)]
    every: Every,
    #[command(flatten)]
    frames: FrameOptions,
    /// Machine file with the frames; without it, the one that was recorded
    #[arg(long, value_name = "FILE", requires = "FrameOptions")]
    config: Option<PathBuf>,
    /// Units of the columns of --tool and --work, a length and an angle, for example nm,arcsec; without it m and rad
    #[arg(long, value_name = "LENGTH,ANGLE", value_parser = MotionUnits::read, requires = "FrameOptions")]
    units: Option<MotionUnits>,
}

impl ConvertArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let recording = Recording::open(&self.recording)?;
        let summary = recording.summary()?;
        recording.remark(&summary);
        let config = Config::parse(&summary.info.configuration, "configuration of the recording")?;
        let CycleInstants { reference_ns, .. } = CycleInstants::of_controller(&config);
        let home = config.machine.home;
        let with_frames = self.config.as_deref().map_or(Ok(config), Config::load)?;
        let coordinates = self.frames.coordinates(&with_frames)?;
        let tool = (!coordinates.is_empty()).then_some((coordinates, self.units));
        let origin = TableOrigin { home, reference_ns, tool };
        let choice = TableChoice { columns: self.columns, every: self.every };
        let (summary, rows) = write_csv(&recording, &origin, &choice, &self.csv)?;
        if is_standard(&self.csv) {
            return Ok(());
        }
        let rows = if self.every == Every::Cycles(1) { String::new() } else { format!("{rows} rows of ") };
        Ok(print(format_args!("{}: {rows}{} cycles\n", self.csv.display(), summary.cycles))?)
    }
}

/// Reader of `--every`.
fn every(text: &str) -> Result<Every, String> {
    match text.parse() {
        Ok(count @ 1..) => Ok(Every::Cycles(count)),
        _ => time_within(text, ["1us", "86400s"])
            .ok()
            .map(|time_s| Every::Time((1e9 * time_s).round() as u64))
            .ok_or_else(|| {
                "must be a number of cycles, at least 1, or a time in [1us, 86400s], as 10 or 10ms".into()
            }),
    }
}
