//! `hexad hold`: keeps the platform under control at its pose until Ctrl-C, then stops it.

use std::time::Duration;

use clap::Args;

use super::arguments::{EngageOptions, MachineFile};
use super::failure::Failure;
use super::motion_client::{MotionClient, MotionError};
use super::request::machine_name;
use hexad_client::operator::Order;
use hexad_client::operator::motion_fields::HOLD;
use hexad_client::operator::stops::stop_machine;
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::state::Request;
use hexad_machine::text::files::print;

/// Longest wait for the stop at the end.
const STOP_LIMIT: Duration = Duration::from_secs(30);

/// Interval at which the state is read.
const STATUS_INTERVAL: Duration = Duration::from_millis(200);

#[derive(Debug, Args)]
pub struct HoldArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    engage: EngageOptions,
}

impl HoldArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let (machine, stop) = (machine_name(self.machine.path())?, Stop::on_signals()?);
        let mut client = MotionClient::connect(&machine, &stop)?;
        match client.carry_out(self.engage.line(HOLD), |_| Ok(())) {
            Ok(_) => print("the platform stands under control; Ctrl-C ends it with a stop\n")?,
            // A stop follows, because control may have been taken just now.
            Err(MotionError::Interrupted | MotionError::InterruptedEarly) => {}
            Err(error) => return Err(error.into()),
        }
        let has_control = client.status_under_control().is_ok();
        while !stop.is_requested() {
            client.status_under_control()?;
            stop.wait(STATUS_INTERVAL);
        }
        // The wait for this stop must not end by the signal that has caused it.
        let order = Order::new(Request::Stop, STOP_LIMIT);
        let outcome = stop_machine(&machine, &order, &|| false);
        if !has_control {
            // Without control there is nothing to stop, unless control was taken just now.
            return Err(MotionError::InterruptedEarly.into());
        }
        Ok(print(format_args!("{}\n", outcome?))?)
    }
}
