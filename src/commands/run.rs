//! `hexad run`: the controller daemon.

use std::path::PathBuf;

use clap::{Args, value_parser};

use super::arguments::MachineFile;
use super::failure::Failure;
use hexad_client::realtime::stop_request::Stop;
use hexad_daemon::recorder::Folders;
use hexad_daemon::recorder::folder::Bounds;

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
    /// Record every cycle into this folder, as MCAP
    #[arg(long, value_name = "FOLDER")]
    record: Option<PathBuf>,
    /// Write the 30 s before each fault, and a second after it, into this folder, as MCAP
    #[arg(long, value_name = "FOLDER", env = "LOGS_DIRECTORY")]
    faults: Option<PathBuf>,
    /// Begin a new file of a recording at this size
    #[arg(long, value_name = "MIB", default_value_t = 256, value_parser = value_parser!(u64).range(1..=65_536))]
    record_file_mib: u64,
    /// Delete the oldest recordings of the machine in a folder above this size, over all runs
    #[arg(long, value_name = "MIB", default_value_t = 4096, value_parser = value_parser!(u64).range(2..=16_777_216))]
    record_total_mib: u64,
    /// Keep an emergency stop, and the confirmation of the legs, in this folder, also while no daemon runs
    #[arg(long, value_name = "FOLDER", env = "STATE_DIRECTORY")]
    state: Option<PathBuf>,
}

impl RunArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let Self { machine, report, histogram, record, faults, record_file_mib, record_total_mib, state } =
            self;
        let bounds = Bounds { file: record_file_mib << 20, total: record_total_mib << 20 };
        let folders = Folders { record, faults, bounds };
        let (config, stop) = (machine.load()?, Stop::on_signals()?);
        hexad_daemon::run(&config, &hexad_daemon::Files { report, histogram, folders, state }, &stop)?;
        Ok(())
    }
}
