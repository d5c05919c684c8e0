//! `hexad recover`: completes a recording that a crash or a full disk has left unfinished.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use crate::output::files::print;
use crate::recording::copy::copy;
use crate::recording::reader::Recording;

#[derive(Debug, Args)]
pub struct RecoverArguments {
    /// Recording that is not complete; it is replaced once the new one is whole
    #[arg(value_name = "FILE")]
    recording: PathBuf,
    /// Write the complete one to another place, and leave the old as it is
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

impl RecoverArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let recording = Recording::open(&self.recording)?;
        let summary = recording.summary()?;
        let output = self.output.as_ref().unwrap_or(&self.recording);
        let Some(why) = summary.unfinished else {
            return Ok(print(format_args!("{}: it is complete\n", self.recording.display()))?);
        };
        let messages = copy(&recording, output, 0..=u64::MAX)?;
        Ok(print(format_args!(
            "{}: {} cycles, {messages} messages; the rest is lost: {why}\n",
            output.display(),
            summary.cycles
        ))?)
    }
}
