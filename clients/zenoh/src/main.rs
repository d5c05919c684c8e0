//! The command `hexad-zenoh`; see `hexad-zenoh --help`.
//!
//! | module | computes |
//! | --- | --- |
//! | [`network_file`], [`access`] | the file of the networks, and from it mutual TLS and the list of what each certificate may do |
//! | [`access_log`] | what Zenoh has refused |
//! | [`setpoints`], [`requests`], [`motions`], [`telemetry`] | each kind of message |
//! | [`bridge`] | the loop of a machine |
//! | [`fleet`] | status and stops of many machines |

mod access;
mod access_log;
mod bridge;
mod fleet;
mod motions;
mod network_file;
mod requests;
mod setpoints;
mod telemetry;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{ArgGroup, Parser, Subcommand};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::state::Request;
use hexad_machine::config::Config;
use hexad_machine::log::{self, LogFormat};
use tracing_subscriber::Layer;

use crate::access_log::{AccessLog, LIBRARY};
use crate::bridge::Bridge;
use crate::fleet::FleetFile;
use crate::network_file::NetworkFile;

/// Bridge between a machine and Zenoh, and status and stops of many machines. Read docs/network.md first.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Connects a machine, until Ctrl-C
    Run {
        /// Network file
        network: PathBuf,
        /// Machine file
        machine: PathBuf,
    },
    /// Prints the state of all machines that answer
    Status {
        /// File with the operator's certificate and the machines
        fleet: PathBuf,
        /// Print each answer as JSON
        #[arg(long)]
        json: bool,
    },
    /// Brings platforms to rest under control, then disables forces
    Stop(StopArguments),
    /// Disables forces, and latches a fault; no safety function
    Estop(StopArguments),
}

#[derive(Debug, clap::Args)]
#[command(group = ArgGroup::new("which").required(true).args(["machine", "all"]))]
struct StopArguments {
    /// File with the operator's certificate and the machines
    fleet: PathBuf,
    /// Name of a machine of the file
    machine: Option<String>,
    /// All machines of the file
    #[arg(long)]
    all: bool,
}

/// Error with its exit code: 1 if the command ran and failed, 2 if it could not begin.
type Failure = (u8, String);

impl Command {
    fn execute(self) -> Result<(), Failure> {
        match self {
            Self::Run { network, machine } => run(&network, &machine).map_err(|error| (2, error)),
            Self::Status { fleet, json } => load(&fleet)?.print_status(json).map_err(|error| (1, error)),
            Self::Stop(arguments) => arguments.send(Request::Stop),
            Self::Estop(arguments) => arguments.send(Request::Estop),
        }
    }
}

fn load(fleet: &Path) -> Result<FleetFile, Failure> {
    FleetFile::load(fleet).map_err(|error| (2, error))
}

impl StopArguments {
    fn send(&self, request: Request) -> Result<(), Failure> {
        load(&self.fleet)?.stop(request, self.machine.as_deref()).map_err(|error| (1, error))
    }
}

fn run(network: &Path, machine: &Path) -> Result<(), String> {
    let (access_log, refusals) = AccessLog::new();
    let _log = log::install_beside(LogFormat::Text, LIBRARY, access_log.with_filter(access_log::events()));
    let place = network.display();
    let text = fs::read_to_string(network).map_err(|error| format!("{place}: {error}"))?;
    let file = NetworkFile::parse(&text, network)?;
    let config = Config::load(machine).map_err(|error| error.to_string())?;
    let stop = Stop::on_signals().map_err(|error| error.to_string())?;
    let bridge = Bridge::open(&file, &config, refusals).map_err(|error| format!("{place}: {error}"))?;
    bridge.run(&stop);
    Ok(())
}

fn main() -> ExitCode {
    match CommandLine::parse().command.execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err((code, error)) => {
            log::report_failure(&error);
            ExitCode::from(code)
        }
    }
}
