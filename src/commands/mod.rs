//! The command line: one file or folder for each command.
//!
//! Exit codes: 0 done; 1 the command ran and failed (a fault, a row without solution); 2 it could not begin
//! (bad command line, configuration, input or environment).

use std::path::{Path, PathBuf};

use self::advise::Advice;
use self::check::Check;
use self::demo::Demo;
use self::doctor::Doctor;
use self::faults::Faults;
use self::messages::{Declarations, Language};
use self::operate::Order;
use self::workspace::Survey;
use crate::config::Config;
use crate::control::state::Request;
use crate::daemon;
use crate::model::fidelity::Fidelity;
use crate::output::files::print;
use crate::output::machine_drawing;
use crate::realtime::stop_request::Stop;
use clap::{Parser, Subcommand, ValueEnum};

use self::arguments::{
    Files, FormatName, MachineFile, MotionName, Patience, Start, What, WishArguments, duration, fidelities,
};
use self::failure::Failure;

pub mod advise;
mod arguments;
pub mod check;
pub mod demo;
pub mod doctor;
pub mod export;
mod failure;
pub mod faults;
pub mod messages;
pub mod r#move;
pub mod offline;
pub mod operate;
pub mod plant;
pub mod workspace;

/// Hard real-time computed-torque controller for Gough-Stewart platforms.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the controller daemon until SIGINT or SIGTERM
    Run {
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
    },
    /// Simulate the hardware as a process of its own
    Plant {
        #[command(flatten)]
        machine: MachineFile,
    },
    /// Play a motion or a trajectory as a setpoint source
    Move {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        what: What,
        /// Length of the motion [s]
        #[arg(long, default_value_t = 8.0, value_parser = duration, allow_negative_numbers = true, conflicts_with = "trajectory")]
        seconds: f64,
        /// Also ask for control, once, as soon as it can be had
        #[arg(long)]
        engage: bool,
    },
    /// Run daemon, plant and setpoint source through a motion; print timing and tracking, draw pictures
    Demo {
        /// Machine file [default: the built-in fried2008]
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
        /// Machine file of the plant, if it shall differ from the controller's
        #[arg(long, value_name = "FILE")]
        plant_config: Option<PathBuf>,
        /// The motion to make
        #[arg(long, value_enum, default_value_t = MotionName::Paper)]
        motion: MotionName,
        /// Length of the motion [s]; approach and settling come on top
        #[arg(long, default_value_t = 8.0, value_parser = duration, allow_negative_numbers = true)]
        seconds: f64,
        /// Rate of the loop [Hz], instead of the configured one
        #[arg(long, allow_negative_numbers = true)]
        rate_hz: Option<f64>,
        /// Write a JSON report
        #[arg(long, value_name = "FILE")]
        report: Option<PathBuf>,
        /// Folder for the pictures
        #[arg(long, value_name = "FOLDER", default_value = "hexad-demo")]
        charts: PathBuf,
    },
    /// Take control: the platform follows the setpoint from now on
    Engage {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        patience: Patience,
        /// Wait for measurements and for a setpoint where the platform stands, instead of being refused
        #[arg(long)]
        wait: bool,
    },
    /// Come to rest under control, then let go
    Stop {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        patience: Patience,
    },
    /// Come to rest, go to the home pose, then let go
    Park {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        patience: Patience,
    },
    /// Leave a fault; the platform stays without force until engaged
    Clear {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        patience: Patience,
    },
    /// Let go at once
    Off {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        patience: Patience,
    },
    /// Let go at once, and stay so until cleared
    Estop {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        patience: Patience,
    },
    /// Show what the numbers of states, faults and limits mean, and what to do
    Faults,
    /// Print the declarations of the messages for a driver in another language
    Messages {
        /// The language of the declarations
        #[arg(long, value_enum)]
        language: Language,
    },
    /// Validate a machine file and show the machine at home
    Check {
        #[command(flatten)]
        machine: MachineFile,
        /// Draw the machine at home (SVG): from above, from the side, in perspective, with numbered joints
        #[arg(long, value_name = "FILE")]
        drawing: Option<PathBuf>,
    },
    /// Show what this host offers to a hard real-time loop, and which rates its wake-ups allow
    Doctor {
        /// Machine file whose CPU, priority and rate are meant [default: the built-in fried2008]
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
        /// CPU of the real-time thread, instead of the configured one
        #[arg(long)]
        cpu: Option<usize>,
        /// Length of the measurement, all rates together [s]
        #[arg(long, default_value_t = 10.0, value_parser = duration, allow_negative_numbers = true)]
        seconds: f64,
        /// Write a JSON report
        #[arg(long, value_name = "FILE")]
        report: Option<PathBuf>,
        /// Measure although a controller runs on the same CPUs, and delay it
        #[arg(long)]
        disturb: bool,
    },
    /// Show what each model of the ladder costs over a scene, and recommend one
    Advise {
        #[command(flatten)]
        machine: MachineFile,
        /// A CSV file with t, X, X', X'', instead of the envelope
        #[arg(long, value_name = "FILE")]
        trajectory: Option<PathBuf>,
    },
    /// Map what the machine reaches and what it can do there; find the largest regions without obstacle
    Workspace {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        wish: WishArguments,
    },
    /// Write the machine as a model for other tools
    Export {
        #[command(flatten)]
        machine: MachineFile,
        /// The language of the model
        #[arg(long, value_enum)]
        format: FormatName,
        /// File to write [default: standard output]
        #[arg(long, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Forces, lengths and their derivatives for a file of motions
    InverseDynamics {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        files: Files,
        /// The dynamic model
        #[arg(long, default_value = Fidelity::Exact.name(), value_parser = fidelities())]
        model: Fidelity,
    },
    /// Poses, and twists if there are rates, for a file of leg lengths
    ForwardKinematics {
        #[command(flatten)]
        machine: MachineFile,
        #[command(flatten)]
        files: Files,
        /// Where each row starts
        #[arg(long, value_enum, default_value_t = Start::Previous)]
        start: Start,
    },
}

impl Cli {
    /// Does what the command line asks for.
    pub fn run(self) -> Result<(), Failure> {
        match self.command {
            Command::Run { machine, report, histogram, faults } => {
                let (config, stop) = (machine.load()?, stop()?);
                daemon::run(&config, &daemon::Files { report, histogram, faults }, &stop)
                    .map(drop)
                    .map_err(Failure::could_not_begin)
            }
            Command::Plant { machine } => {
                let (config, stop) = (machine.load()?, stop()?);
                plant::run(&config, &stop).map_err(Failure::could_not_begin)
            }
            Command::Move { machine, what, seconds, engage } => {
                let config = machine.load()?;
                let score = what.score(&config, seconds)?;
                r#move::run(&config, &score, engage, &stop()?).map_err(Failure::could_not_begin)
            }
            Command::Demo { config, plant_config, motion, seconds, rate_hz, report, charts } => {
                let motion = motion.to_possible_value().map_or_else(String::new, |v| v.get_name().into());
                let demo = Demo { config, plant_config, motion, seconds, rate_hz, report, charts };
                demo::run(&demo, &stop()?).map_err(Failure::from)
            }
            Command::Engage { machine, patience, wait } => ask(&machine, Request::Engage, wait, &patience),
            Command::Stop { machine, patience } => ask(&machine, Request::Stop, false, &patience),
            Command::Park { machine, patience } => ask(&machine, Request::Park, false, &patience),
            Command::Clear { machine, patience } => ask(&machine, Request::Clear, false, &patience),
            Command::Off { machine, patience } => ask(&machine, Request::Off, false, &patience),
            Command::Estop { machine, patience } => ask(&machine, Request::Estop, false, &patience),
            Command::Faults => Ok(print(Faults)?),
            Command::Messages { language } => Ok(print(Declarations(language))?),
            Command::Check { machine, drawing } => check(&machine.load()?, drawing.as_deref()),
            Command::Doctor { config, cpu, seconds, report, disturb } => {
                let doctor = Doctor { config, cpu, seconds, report, disturb };
                doctor::run(&doctor, &stop()?).map_err(Failure::from)
            }
            Command::Advise { machine, trajectory } => {
                Ok(print(Advice::new(&machine.load()?, trajectory.as_deref())?)?)
            }
            Command::Workspace { machine, wish } => {
                let survey = Survey::new(&machine.load()?, &wish.into()).map_err(Failure::could_not_begin)?;
                Ok(print(survey)?)
            }
            Command::Export { machine, format, output } => {
                export::export(&machine.load()?, format.into(), output.as_deref())
                    .map_err(Failure::could_not_begin)
            }
            Command::InverseDynamics { machine, files, model } => {
                let machine = machine.load()?.machine;
                Ok(offline::inverse_dynamics_file(&machine, model, &files.input, &files.output)?)
            }
            Command::ForwardKinematics { machine, files, start } => {
                let machine = machine.load()?.machine;
                Ok(offline::forward_kinematics_file(&machine, start.into(), &files.input, &files.output)?)
            }
        }
    }
}

/// Prints the figures before it draws: they are of use where no file can be written.
fn check(config: &Config, drawing: Option<&Path>) -> Result<(), Failure> {
    print(Check::new(config))?;
    let Some(path) = drawing else { return Ok(()) };
    machine_drawing::write_svg(path, &config.name, &config.machine)?;
    Ok(print(format_args!("drawing of the machine at home: {}\n", path.display()))?)
}

fn ask(machine: &MachineFile, request: Request, wait: bool, patience: &Patience) -> Result<(), Failure> {
    let config = machine.load()?;
    let order = Order { request, is_patient: wait, timeout: patience.longest() };
    let state = operate::run(&config, &order, &stop()?)?;
    Ok(print(format_args!("{}\n", state.name()))?)
}

/// Signals end the command in order instead of killing it.
fn stop() -> Result<Stop, Failure> {
    Stop::on_signals().map_err(Failure::could_not_begin)
}
