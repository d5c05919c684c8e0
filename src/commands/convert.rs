//! `hexad convert`: a recording in another format.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::report::signals::CycleInstants;
use crate::config::Config;
use crate::output::files::{is_standard, print};
use crate::recording::reader::Recording;
use crate::recording::table::{TableOrigin, write_csv};

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
        let info = recording.summary()?.info;
        let config = Config::parse(&info.configuration, "configuration of the recording")?;
        let CycleInstants { reference_ns, .. } = CycleInstants::of_controller(&config);
        let origin = TableOrigin { home: config.machine.home, reference_ns };
        let summary = write_csv(&recording, &origin, &self.csv)?;
        if is_standard(&self.csv) {
            return Ok(());
        }
        Ok(print(format_args!("{}: {} cycles\n", self.csv.display(), summary.cycles))?)
    }
}
