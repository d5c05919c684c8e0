//! `hexad hold`: keeps the platform under control at its pose until Ctrl-C, then stops it.

use std::time::Duration;

use clap::Args;

use super::arguments::{MachineFile, duration};
use super::failure::Failure;
use super::target::{TargetError, TargetSource, constants};
use crate::analysis::target_motion::check_target;
use crate::commands::target::pose_of;
use crate::control::signals::state::Request;
use crate::operator::Order;
use crate::operator::stops::stop_machine;
use crate::output::files::print;
use crate::realtime::stop_request::Stop;

/// Longest wait for the stop at the end.
const STOP_LIMIT: Duration = Duration::from_secs(30);

#[derive(Debug, Args)]
pub struct HoldArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Take control, if the platform is not under control
    #[arg(long)]
    engage: bool,
    /// Longest to wait for control [s]
    #[arg(long, default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true, requires = "engage")]
    within: f64,
}

impl HoldArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let (config, stop) = (self.machine.load()?, Stop::on_signals()?);
        let constants = constants(&config);
        let within = self.engage.then(|| Duration::from_secs_f64(self.within));
        let mut source = TargetSource::open(&config, within, &stop)?;
        let x = source.resting_x(&constants)?;
        check_target(&constants, &pose_of(&x)).map_err(TargetError::Refused)?;
        let mut has_control = false;
        while !stop.is_requested() {
            source.publish(x)?;
            if source.active_since().is_some() && !has_control {
                has_control = true;
                print("the platform stands under control; Ctrl-C ends it with a stop\n")?;
            }
        }
        // The wait for this stop must not end by the signal that has caused it.
        let order = Order { request: Request::Stop, is_patient: false, timeout: STOP_LIMIT, remote: None };
        let outcome = stop_machine(&config.name, &order, &|| false);
        if !has_control {
            // Without control there is nothing to stop, unless control was taken just now.
            return Err(TargetError::InterruptedEarly.into());
        }
        Ok(print(format_args!("{}\n", outcome?))?)
    }
}
