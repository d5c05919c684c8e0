//! The command `hexad-ros2`; see `hexad-ros2 --help`.
//!
//! | module | computes |
//! | --- | --- |
//! | [`network_file`] | the file of the networks |
//! | [`ros_messages`], [`conversion`], [`telemetry`] | messages of ROS 2, motions in them, measured motion as messages |
//! | [`node`], [`first_request`], [`requests`], [`bridge`] | the node with its topics and services, requests, the loop |

mod bridge;
mod conversion;
mod first_request;
mod network_file;
mod node;
mod requests;
mod ros_messages;
mod telemetry;

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use hexad_client::realtime::stop_request::Stop;
use hexad_machine::config::Config;
use hexad_machine::log::{self, LogFormat};

use crate::bridge::Bridge;
use crate::network_file::NetworkFile;

/// Bridge between a machine and ROS 2, over DDS. Read docs/network.md first: DDS has no identity of sources.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
struct CommandLine {
    /// Network file
    network: PathBuf,
    /// Machine file
    machine: PathBuf,
}

impl CommandLine {
    fn execute(&self) -> Result<(), String> {
        let place = self.network.display().to_string();
        let text = fs::read_to_string(&self.network).map_err(|error| format!("{place}: {error}"))?;
        let file = NetworkFile::parse(&text, &place)?;
        let config = Config::load(&self.machine).map_err(|error| error.to_string())?;
        let stop = Stop::on_signals().map_err(|error| error.to_string())?;
        let mut bridge = Bridge::open(&file, &config).map_err(|error| format!("{place}: {error}"))?;
        bridge.run(&stop);
        Ok(())
    }
}

fn main() -> ExitCode {
    let command = CommandLine::parse();
    let _log = log::install_without(&["rustdds", "ros2_client"], LogFormat::Text);
    match command.execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            log::report_failure(&error);
            ExitCode::from(2)
        }
    }
}
