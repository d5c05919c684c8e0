//! The command line: one file or folder for each command.
//!
//! Exit codes: 0 done; 1 the command ran and failed (a fault, a row without solution; for the daemon also a
//! shortage that may end: memory, a socket, a machine controlled by another daemon); 2 it could not begin
//! (bad command line, configuration, input or environment); 130 a signal ended it before it had finished.

use clap::{Parser, Subcommand};

use self::arguments::MachineFile;
use self::failure::Failure;
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::state::Request;
use hexad_daemon::version::VERSION;
use hexad_machine::log::{FORMAT_VARIABLE, LogFormat};

pub mod advise;
mod arguments;
mod calibrate;
pub mod check;
mod confirm_legs;
mod convert;
pub mod demo;
pub mod doctor;
mod excite;
pub mod export;
mod failure;
pub mod faults;
pub mod forward_kinematics;
mod frame;
mod frame_options;
mod goto;
mod hold;
mod identify;
pub mod inverse_dynamics;
mod jog;
mod machine_file;
mod manuals;
pub mod messages;
mod motion_client;
pub mod r#move;
mod offline_tables;
pub mod orientation;
pub mod plant;
mod progress;
mod quantity;
mod record;
mod recover;
mod replay;
mod report;
mod request;
mod ride;
mod run;
pub mod status;
mod view;
pub mod workspace;

/// Hard real-time computed-torque controller for Gough-Stewart platforms.
#[derive(Debug, Parser)]
#[command(version = VERSION, arg_required_else_help = true)]
pub struct CommandLine {
    /// Format of the log on standard error
    #[arg(long, global = true, value_enum, default_value_t, env = FORMAT_VARIABLE)]
    pub log_format: LogFormat,
    #[command(subcommand)]
    command: CommandArguments,
}

#[derive(Debug, Subcommand)]
enum CommandArguments {
    /// Run the controller daemon until SIGINT or SIGTERM
    Run(run::RunArguments),
    /// Simulate the hardware as a process of its own
    Plant(MachineFile),
    /// Play a motion or a trajectory as a setpoint source
    Move(r#move::MoveArguments),
    /// Play a motion from which masses, friction and the delay of the drives can be identified
    Excite(excite::ExciteArguments),
    /// Move the platform to a pose and hold it there under control
    Goto(goto::GotoArguments),
    /// Keep the platform under control where it is, until Ctrl-C; then stop
    Hold(hold::HoldArguments),
    /// Begin or end a ride that a stream of poses moves (move --udp)
    Ride(ride::RideArguments),
    /// Move the platform by keys on a terminal, while they are held
    Jog(jog::JogArguments),
    /// Move one leg after the other, and keep which leg a person sees moving: exchanged cables look correct to the daemon
    ConfirmLegs(confirm_legs::ConfirmLegsArguments),
    /// Run daemon, plant and setpoint source through a motion; print timing and tracking, draw pictures
    Demo(demo::DemoArguments),
    /// Take control: the platform follows the setpoint from now on
    Engage(request::EngageArguments),
    /// Come to rest under control, then disable the forces; the brakes close
    Stop(request::StopArguments),
    /// Come to rest, go to the home pose, then disable the forces; the brakes close
    Park(request::RequestArguments),
    /// Leave a fault; the platform stays without force until engaged
    Clear(request::RequestArguments),
    /// Disable the forces at once; the brakes close
    Off(request::StopArguments),
    /// Disable the forces at once, until cleared; the brakes close
    Estop(request::StopArguments),
    /// Take over gains, limits and timeouts of the daemon's machine file, while no force is valid
    Reload(request::RequestArguments),
    /// Show state, diagnostic, pose, legs, timing and sources of a running daemon
    Status(status::StatusArguments),
    /// Show the charts of a recording's page live, for a browser on this host
    View(view::ViewArguments),
    /// Show what the numbers of states, faults and limits mean, and what to do
    Faults(faults::FaultsArguments),
    /// Print the declarations of the messages for a driver in another language
    Messages(messages::MessagesArguments),
    /// Show the named frames of a machine file, or set one where the platform is
    Frame(frame::FrameArguments),
    /// Validate a machine file and show the machine at home
    Check(check::CheckArguments),
    /// Show what this host offers to a hard real-time loop, and which rates its wake-ups allow
    Doctor(doctor::DoctorArguments),
    /// Calibrate the joints and the zeros of the lengths from poses that a tracker has measured
    Calibrate(calibrate::CalibrateArguments),
    /// Identify masses, friction and force scales of the machine from recordings of its motions
    Identify(identify::IdentifyArguments),
    /// Show the error and the time of each model fidelity over an envelope or a trajectory, and recommend one
    Advise(advise::AdviseArguments),
    /// Map what the machine reaches and what it can do there; find the largest regions without obstacle
    Workspace(workspace::WorkspaceArguments),
    /// Write the machine as a model for other tools
    Export(export::ExportArguments),
    /// Compute the cycles of a recording again and compare every output; or copy a part of it
    Replay(replay::ReplayArguments),
    /// Write a recording as one page with charts, which any browser opens from disk
    Report(report::ReportArguments),
    /// Write a recording in another format
    Convert(convert::ConvertArguments),
    /// Write the last seconds of a running daemon, which it keeps in memory, as a recording
    Record(record::RecordArguments),
    /// Complete a recording that a crash or a full disk has left unfinished
    Recover(recover::RecoverArguments),
    /// Forces, lengths and their derivatives for a file of motions
    InverseDynamics(inverse_dynamics::InverseDynamicsArguments),
    /// Poses, and twists if there are rates, for a file of leg lengths
    ForwardKinematics(forward_kinematics::ForwardKinematicsArguments),
    /// Write manual pages and completions of shells into a folder
    #[command(hide = true)]
    Manuals(manuals::ManualsArguments),
}

impl CommandLine {
    /// The command line of this process. If it is wrong, the process ends here, with the reason.
    pub fn from_arguments() -> Self {
        Self::parse()
    }

    /// Executes the command.
    pub fn execute(self) -> Result<(), Failure> {
        use CommandArguments as Is;
        match self.command {
            Is::Run(arguments) => arguments.execute(),
            Is::Plant(machine) => plant::run_on_bus(&machine.load()?, &Stop::on_signals()?),
            Is::Move(arguments) => arguments.execute(),
            Is::Excite(arguments) => arguments.execute(),
            Is::Goto(arguments) => arguments.execute(),
            Is::Ride(arguments) => arguments.execute(),
            Is::Hold(arguments) => arguments.execute(),
            Is::Jog(arguments) => arguments.execute(),
            Is::ConfirmLegs(arguments) => arguments.execute(),
            Is::Demo(arguments) => arguments.execute(),
            Is::Engage(arguments) => arguments.execute(),
            Is::Stop(arguments) => arguments.execute(Request::Stop),
            Is::Park(arguments) => arguments.execute(Request::Park),
            Is::Clear(arguments) => arguments.execute(Request::Clear),
            Is::Off(arguments) => arguments.execute(Request::Off),
            Is::Estop(arguments) => arguments.execute(Request::Estop),
            Is::Reload(arguments) => arguments.reload(),
            Is::Status(arguments) => arguments.execute(),
            Is::View(arguments) => arguments.execute(),
            Is::Faults(arguments) => arguments.execute(),
            Is::Messages(arguments) => arguments.execute(),
            Is::Frame(arguments) => arguments.execute(),
            Is::Check(arguments) => arguments.execute(),
            Is::Doctor(arguments) => arguments.execute(),
            Is::Calibrate(arguments) => arguments.execute(),
            Is::Identify(arguments) => arguments.execute(),
            Is::Advise(arguments) => arguments.execute(),
            Is::Workspace(arguments) => arguments.execute(),
            Is::Export(arguments) => arguments.execute(),
            Is::Replay(arguments) => arguments.execute(),
            Is::Report(arguments) => arguments.execute(),
            Is::Convert(arguments) => arguments.execute(),
            Is::Record(arguments) => arguments.execute(),
            Is::Recover(arguments) => arguments.execute(),
            Is::InverseDynamics(arguments) => arguments.execute(),
            Is::ForwardKinematics(arguments) => arguments.execute(),
            Is::Manuals(arguments) => arguments.execute(),
        }
    }
}
