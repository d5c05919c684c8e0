//! `hexad engage | stop | park | clear | off | estop | reload`: an operator's request and its result.
//!
//! Exit code 0 means that every addressed machine has reached the state of the request.

use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::thread::spawn;
use std::time::Duration;

use clap::Args;
use tracing::info;

use super::arguments::{MachineFile, OptionalMachineFile, duration};
use super::failure::Failure;
use hexad_client::operator::requests::{self, carry_out};
use hexad_client::operator::stops::{Stopped, Target, stop};
use hexad_client::operator::{OperatorError, Order};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::state::Request;
use hexad_machine::config::ConfigError;
use hexad_machine::config::machine_name::name_in;
use hexad_machine::text::files::{print, remark};

#[derive(Debug, Args)]
pub struct RequestArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    wait: Wait,
}

#[derive(Debug, Args)]
struct Wait {
    /// Longest to wait for the outcome [s]
    #[arg(long, default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true)]
    within: f64,
}

impl Wait {
    fn limit(&self) -> Duration {
        Duration::from_secs_f64(self.within)
    }
}

#[derive(Debug, Args)]
pub struct EngageArguments {
    #[command(flatten)]
    request: RequestArguments,
    /// Wait for measurements and for a setpoint at the pose of the platform, instead of being refused
    #[arg(long)]
    wait: bool,
    /// Pose of the platform, by its number in a refusal that lists several with the measured lengths
    #[arg(long)]
    pose: Option<u32>,
}

#[derive(Debug, Args)]
pub struct StopArguments {
    #[command(flatten)]
    machine: OptionalMachineFile,
    /// All machines of this host; `estop` without a machine does that anyway
    #[arg(long, conflicts_with = "OptionalMachineFile")]
    all: bool,
    #[command(flatten)]
    wait: Wait,
}

impl EngageArguments {
    /// Takes control.
    pub fn execute(&self) -> Result<(), Failure> {
        self.request.send(Request::Engage, self.wait, self.pose)
    }
}

impl RequestArguments {
    /// Sends a request other than a stop.
    pub fn execute(&self, request: Request) -> Result<(), Failure> {
        self.send(request, false, None)
    }

    fn send(&self, request: Request, is_patient: bool, pose: Option<u32>) -> Result<(), Failure> {
        let (machine, stop) = (machine_name(self.machine.path())?, Stop::on_signals()?);
        let order = Order { is_patient, pose, ..Order::new(request, self.wait.limit()) };
        let waits = |reason: &str| remark(format_args!("waiting: {reason}"));
        let state = carry_out(&machine, &order, &|| stop.is_requested(), waits)?;
        Ok(print(format_args!("{state}\n"))?)
    }

    /// Requests a reload, and prints the changes.
    pub fn reload(&self) -> Result<(), Failure> {
        let changed = requests::reload(&machine_name(self.machine.path())?, self.wait.limit())?;
        Ok(print(format_args!("{changed}\n"))?)
    }
}

impl StopArguments {
    /// Stops the named machine. Without a name, `--all` or an emergency stop stops all machines; any other stop
    /// needs a single running machine.
    pub fn execute(&self, request: Request) -> Result<(), Failure> {
        let interrupted = Stop::on_signals()?;
        let name = self.machine.path().map(machine_name).transpose()?;
        let target = match &name {
            Some(name) => Target::Named(name),
            None if self.all || request == Request::Estop => Target::All,
            None => Target::Only,
        };
        let order = Order::new(request, self.wait.limit());
        let stopped = stop(target, &order, &|| interrupted.is_requested())?;
        report(stopped, matches!(target, Target::All))
    }
}

/// Prints the states, with the names of the machines if all were addressed. The error is the first one, of
/// the machines that this user may stop if there are any.
fn report(stopped: Vec<Stopped>, with_names: bool) -> Result<(), Failure> {
    let may_any = stopped.iter().any(|it| it.result.as_ref().err().is_none_or(is_answer));
    let mut failures = vec![];
    for Stopped { machine, result, remarks } in stopped {
        remarks.iter().for_each(remark);
        match result {
            Ok(state) if with_names => print(format_args!("{machine}: {state}\n"))?,
            Ok(state) => print(format_args!("{state}\n"))?,
            Err(error) => failures.push((machine, error)),
        }
    }
    let counts = |error: &OperatorError| is_answer(error) || !may_any;
    let first = failures.iter().position(|(_, error)| counts(error));
    let last = first.map(|place| failures.swap_remove(place));
    failures.iter().for_each(|(machine, error)| remark(format_args!("{machine}: {error}")));
    last.map_or(Ok(()), |(_, error)| Err(error.into()))
}

/// Whether a daemon that counts and admits this user has answered.
fn is_answer(error: &OperatorError) -> bool {
    !matches!(error, OperatorError::Forbidden { .. } | OperatorError::NotTrusted { .. })
}

/// Name of the machine of a file. An argument that is not a file but a valid name is the name.
pub fn machine_name(argument: &Path) -> Result<String, ConfigError> {
    let text = argument.to_string_lossy();
    let is_name = !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    if is_name && !argument.exists() { Ok(text.into_owned()) } else { name_in(argument) }
}

/// Sends a request in a separate thread, so that setpoints do not wait. Logs what the request waits for.
pub fn carry_out_in_background(
    machine: &str,
    order: Order<'static>,
    stop: &Stop,
) -> Receiver<Result<(), OperatorError>> {
    let (send, result) = channel();
    let (machine, stop) = (machine.to_owned(), stop.clone());
    spawn(move || {
        let waits = |reason: &str| info!("{} waits: {reason}", order.request.name());
        let outcome = carry_out(&machine, &order, &|| stop.is_requested(), waits);
        // The receiver is gone when the command has ended.
        let _ = send.send(outcome.map(drop));
    });
    result
}
