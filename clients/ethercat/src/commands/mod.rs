//! The commands.

mod bus;
mod run;
mod simulate;

use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand};
use hexad_ethercat::bus::{Bus, Frames};
use hexad_ethercat::drives_file::DrivesFile;
use hexad_ethercat::raw_socket::RawSocket;
use hexad_machine::config::Config;
use tracing::warn;

/// Driver of hexad for CiA 402 drives on EtherCAT. No version of it has run on hardware yet: read docs/ethercat.md first.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub struct CommandLine {
    #[command(subcommand)]
    command: CommandArguments,
}

#[derive(Debug, Subcommand)]
enum CommandArguments {
    /// Print a drives file from what is on the bus, to be completed
    Scan {
        /// Network interface that only the drives are connected to
        interface: String,
        /// `name` of the machine file
        #[arg(long, default_value = "machine")]
        name: String,
    },
    /// Validate a drives file, its machine, and the drives on the bus
    Check {
        /// Drives file
        drives: PathBuf,
        /// Machine file
        #[arg(long, value_name = "FILE")]
        machine: Option<PathBuf>,
        /// Without the bus
        #[arg(long)]
        offline: bool,
    },
    /// Load each closed brake with 1.1 times its load, as `run` does at its start
    Brakes {
        /// Drives file
        drives: PathBuf,
        /// Machine file
        machine: PathBuf,
    },
    /// Drive the machine until SIGINT or SIGTERM
    Run {
        /// Drives file
        drives: PathBuf,
        /// Machine file
        machine: PathBuf,
    },
    /// Simulate the drives of a file with the platform, on the other end of a cable
    Simulate {
        /// Drives file
        drives: PathBuf,
        /// Machine file
        machine: PathBuf,
        /// Network interface of the simulated drives, for instance an end of a veth pair
        #[arg(long)]
        interface: String,
        /// Legs that are not coupled to the platform, to try jog
        #[arg(long)]
        uncoupled: bool,
        /// Force above which the closed brakes slip
        #[arg(long, value_name = "N", default_value_t = f64::INFINITY)]
        brake_n: f64,
    },
    /// Move one leg that is unloaded or uncoupled, to see its direction; it ends after 2 mm
    Jog {
        /// Drives file
        drives: PathBuf,
        /// From 1
        leg: usize,
        /// Torque in thousandths of the rated, negative to shorten the leg
        #[arg(long, default_value_t = 50, allow_negative_numbers = true)]
        permille: i16,
        /// Longest motion
        #[arg(long, default_value_t = 1.0)]
        seconds: f64,
        /// Confirms that the leg carries no load: its brake opens
        #[arg(long)]
        unloaded: bool,
    },
    /// Write the offset of a leg from its measured length into the drives file
    Zero {
        /// Drives file
        drives: PathBuf,
        /// From 1
        leg: usize,
        /// Measured length from joint to joint
        #[arg(long)]
        length_m: f64,
    },
    /// Acknowledge the faults of all drives
    Reset {
        /// Drives file
        drives: PathBuf,
    },
    /// Print an object of a drive
    Read {
        /// Drives file
        drives: PathBuf,
        /// From 1
        leg: usize,
        /// Index and subindex, as 0x6064:0
        object: String,
    },
    /// Write an object of a drive
    Write {
        /// Drives file
        drives: PathBuf,
        /// From 1
        leg: usize,
        /// Index and subindex, as 0x605a:0
        object: String,
        /// The value; hexadecimal with 0x
        #[arg(allow_negative_numbers = true)]
        value: String,
        /// Length of the object
        #[arg(long, default_value_t = 2)]
        bytes: u8,
    },
}

/// Error that ends a command. Exit code 1: the command ran and failed; 2: it could not begin.
#[derive(Debug)]
pub struct Failure {
    pub exit_code: u8,
    pub message: String,
}

fn before_start(error: impl Display) -> Failure {
    Failure { exit_code: 2, message: error.to_string() }
}

fn after_start(error: impl Display) -> Failure {
    Failure { exit_code: 1, message: error.to_string() }
}

impl CommandLine {
    /// Executes the command.
    pub fn execute(self) -> Result<(), Failure> {
        use CommandArguments as Is;
        match self.command {
            Is::Scan { interface, name } => bus::scan(&interface, &name),
            Is::Check { drives, machine, offline } => bus::check(&drives, machine.as_deref(), offline),
            Is::Brakes { drives, machine } => bus::brakes(&drives, &machine),
            Is::Run { drives, machine } => run::run(&drives, &machine),
            Is::Simulate { drives, machine, interface, uncoupled, brake_n } => {
                simulate::simulate(&drives, &machine, &interface, uncoupled, brake_n)
            }
            Is::Jog { drives, leg, permille, seconds, unloaded } => {
                bus::jog(&drives, leg, permille, seconds, unloaded)
            }
            Is::Zero { drives, leg, length_m } => bus::zero(&drives, leg, length_m),
            Is::Reset { drives } => bus::reset(&drives),
            Is::Read { drives, leg, object } => bus::read(&drives, leg, &object),
            Is::Write { drives, leg, object, value, bytes } => {
                bus::write(&drives, leg, &object, &value, bytes)
            }
        }
    }
}

fn load_text(path: &Path) -> Result<String, Failure> {
    fs::read_to_string(path).map_err(|error| before_start(format!("{}: {error}", path.display())))
}

fn load_drives(path: &Path) -> Result<DrivesFile, Failure> {
    DrivesFile::parse(&load_text(path)?, &path.display().to_string()).map_err(before_start)
}

/// Drives that move, with a warning of what the file leaves to people.
fn load_and_warn(path: &Path) -> Result<DrivesFile, Failure> {
    let file = load_drives(path)?;
    file.warnings().iter().for_each(|text| warn!("{text}"));
    Ok(file)
}

fn load_machine(path: &Path) -> Result<Config, Failure> {
    Config::load(path).map_err(before_start)
}

/// Errors as a failure before the start, if there are any.
fn none_of(errors: Vec<String>) -> Result<(), Failure> {
    if errors.is_empty() { Ok(()) } else { Err(before_start(errors.join("\n"))) }
}

/// Main device on an interface.
fn open<'f>(frames: &'f Frames, interface: &str) -> Result<Bus<'f, RawSocket>, Failure> {
    let socket = RawSocket::open(interface).map_err(before_start)?;
    Bus::new(frames, socket).ok_or_else(|| before_start("the memory of the frames is in use"))
}
