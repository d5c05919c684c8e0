//! `hexad run`: the controller daemon.

use std::path::PathBuf;

use clap::Args;

use super::arguments::MachineFile;
use super::failure::Failure;
use crate::daemon;
use crate::realtime::stop_request::Stop;

#[derive(Debug, Args)]
pub struct RunArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Write a JSON report at the end
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Write how often each time occurred, as CSV, at the end
    #[arg(long, value_name = "FILE")]
    histogram: Option<PathBuf>,
    /// Write the cycles around each fault as CSV into this folder
    #[arg(long, value_name = "FOLDER", env = "LOGS_DIRECTORY")]
    faults: Option<PathBuf>,
    /// Keep an emergency stop in this folder until it is cleared, also while no daemon runs
    #[arg(long, value_name = "FOLDER", env = "STATE_DIRECTORY")]
    state: Option<PathBuf>,
}

impl RunArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let Self { machine, report, histogram, faults, state } = self;
        let (config, stop) = (machine.load()?, Stop::on_signals()?);
        daemon::run(&config, &daemon::Files { report, histogram, faults, state }, &stop)?;
        Ok(())
    }
}
