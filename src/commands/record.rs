//! `hexad record`: the last seconds of a running daemon, as a recording.

use std::path::PathBuf;

use clap::Args;

use super::arguments::{MachineFile, duration};
use super::failure::Failure;
use super::operate;
use crate::output::files::{print, write_whole_with};

#[derive(Debug, Args)]
pub struct RecordArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Length of the recording [s]; the daemon keeps 30 s, less above 4 kHz
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true)]
    last: f64,
    /// File to write
    #[arg(long, short, value_name = "FILE", default_value = "last.mcap")]
    output: PathBuf,
}

impl RecordArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        let mut written = String::new();
        write_whole_with(&self.output, |file| -> Result<(), Failure> {
            written = operate::record(&config.name, self.last, file)?;
            Ok(())
        })?;
        Ok(print(format_args!("{}: {written}\n", self.output.display()))?)
    }
}
