//! `hexad recover`: completes a recording that a crash or a full disk has left unfinished.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use hexad_daemon::recording::copy::copy;
use hexad_daemon::recording::damage_text;
use hexad_daemon::recording::reader::{Recording, Summary};
use hexad_machine::text::files::print;

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
        let Summary { unfinished, damage, cycles, .. } = summary;
        let damaged = (!damage.is_empty())
            .then(|| format!("damaged (cycles of these times are left out): {}", damage_text(&damage)));
        let lost: Vec<_> =
            damaged.into_iter().chain(unfinished.map(|why| format!("the rest is lost: {why}"))).collect();
        if lost.is_empty() {
            return Ok(print(format_args!("{}: it is complete\n", self.recording.display()))?);
        }
        let messages = copy(&recording, output, 0..=u64::MAX)?;
        Ok(print(format_args!(
            "{}: {cycles} cycles, {messages} messages; {}\n",
            output.display(),
            lost.join("; ")
        ))?)
    }
}
