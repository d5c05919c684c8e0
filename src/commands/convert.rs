//! `hexad convert`: a recording in another format.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::report::signals::CycleInstants;
use hexad_daemon::recording::reader::Recording;
use hexad_daemon::recording::table::{TableOrigin, write_csv};
use hexad_machine::config::Config;
use hexad_machine::text::files::{is_standard, print};

#[derive(Debug, Args)]
pub struct ConvertArguments {
    /// Recording of `hexad run --record` or `--faults`
    #[arg(value_name = "FILE")]
    recording: PathBuf,
    /// Write a row for each cycle; `-` is standard output
    #[arg(long, value_name = "FILE")]
    csv: PathBuf,
}

impl ConvertArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let recording = Recording::open(&self.recording)?;
        let summary = recording.summary()?;
        recording.remark(&summary);
        let config = Config::parse(&summary.info.configuration, "configuration of the recording")?;
        let CycleInstants { reference_ns, .. } = CycleInstants::of_controller(&config);
        let origin = TableOrigin { home: config.machine.home, reference_ns };
        let summary = write_csv(&recording, &origin, &self.csv)?;
        if is_standard(&self.csv) {
            return Ok(());
        }
        Ok(print(format_args!("{}: {} cycles\n", self.csv.display(), summary.cycles))?)
    }
}
