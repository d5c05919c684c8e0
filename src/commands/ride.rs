//! `hexad ride start | end`: the operator begins and ends a ride of `hexad move --udp`. Its stream never does.
//!
//! An order is valid only while this command waits, and only if no stop comes meanwhile.

use std::io::{IsTerminal, stdin};
use std::time::Duration;

use clap::{Args, ValueEnum};

use super::arguments::{MachineFile, duration};
use super::failure::Failure;
use super::request::machine_name;
use hexad_client::operator::OperatorError;
use hexad_client::operator::protocol::RequestResult;
use hexad_client::operator::requests::{ride, status};
use hexad_client::operator::ride::{RideOrder, RidePhase};
use hexad_client::realtime::stop_request::Stop;
use hexad_machine::text::files::{print, remark};

#[derive(Debug, Args)]
pub struct RideArguments {
    /// What the operator wants
    #[arg(value_enum)]
    order: Order,
    #[command(flatten)]
    machine: MachineFile,
    /// Longest to wait for the stream, at most 60 [s]
    #[arg(long, default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true)]
    within: f64,
    /// Begin even if the stream looks as if it had other units than its format
    #[arg(long)]
    yes: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Order {
    /// Follow the stream from the boarding pose on; waits for the stream
    Start,
    /// Move back to the boarding pose and stand there
    End,
}

impl RideArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let Self { order, machine, within, mut yes } = self;
        let order = match order {
            Order::Start => RideOrder::Start,
            Order::End => RideOrder::End,
        };
        let name = machine_name(machine.path())?;
        if order == RideOrder::Start && !yes {
            yes = is_doubt_accepted(&name)?;
        }
        // After the question, which Ctrl-C ends as usual.
        let (within, stop) = (Duration::from_secs_f64(within), Stop::on_signals()?);
        let answer = ride(&name, order, yes, within, || stop.is_requested())?;
        match answer.result {
            RequestResult::Done => Ok(print(match order {
                RideOrder::Start => "riding\n",
                RideOrder::End => "boarding\n",
            })?),
            result => Err(Failure::after_start(format_args!(
                "{} {}: {}",
                order.name(),
                result.words(),
                answer.text
            ))),
        }
    }
}

/// Shows a person at a terminal why the stream is doubtful, and returns whether it is to be followed all the same.
fn is_doubt_accepted(machine: &str) -> Result<bool, OperatorError> {
    let answer = status(machine)?;
    let processes = answer.status.iter().flat_map(|report| &report.sources).flat_map(|it| &it.processes);
    let Some(source) = processes.into_iter().find(|it| it.ride == Some(RidePhase::Doubtful)) else {
        return Ok(false);
    };
    remark(format_args!("{}", source.input.as_deref().unwrap_or_default()));
    if !stdin().is_terminal() {
        return Ok(false);
    }
    remark(format_args!("begin the ride all the same? [y/N]"));
    let mut line = String::new();
    Ok(stdin().read_line(&mut line).is_ok() && matches!(line.trim(), "y" | "yes"))
}
