//! Requests of operators, as the commands send them.

use std::time::Duration;

use ::hexad_client::operator::connection::Connection;
use ::hexad_client::operator::protocol::is_stop;
use ::hexad_client::operator::requests::{carry_out, post_for_cycle};
use ::hexad_client::operator::stops::stop_machine;
use ::hexad_client::operator::{OperatorError, Order};
use ::hexad_core::control::signals::state::Request;

use crate::outcome::hexad_result::{
    self, HEXAD_FORBIDDEN, HEXAD_INTERNAL, HEXAD_INVALID, HEXAD_NO_DAEMON, HEXAD_NOT_COMPLETED, HEXAD_OK,
    HEXAD_REFUSED, HEXAD_TIMED_OUT,
};
use crate::outcome::{Failure, Outcome};

/// Longest time that the daemon accepts \[s\].
const MAX_WITHIN_S: f64 = 86_400.0;

/// Sends a request to the daemon of a machine and waits for its outcome.
pub fn send(machine: &str, request: u32, until_ready: bool, within_s: f64) -> Outcome {
    let request = numbered(request)?;
    if !(0.0..=MAX_WITHIN_S).contains(&within_s) {
        let text = format!("within_s = {within_s} s is not between 0 and {MAX_WITHIN_S} s");
        return Err(Failure::new(HEXAD_INVALID, text));
    }
    let order = Order { is_patient: until_ready, ..Order::new(request, Duration::from_secs_f64(within_s)) };
    let never = || false;
    let outcome = match is_stop(request) {
        true => stop_machine(machine, &order, &never),
        false => carry_out(machine, &order, &never, |_| ()),
    };
    outcome.map(|_| HEXAD_OK).map_err(failure)
}

/// Posts a request for a cycle in simulated time. It is withdrawn when the connection closes before.
pub fn post(machine: &str, request: u32, cycle_ns: u64) -> Result<Connection, Failure> {
    post_for_cycle(machine, numbered(request)?, cycle_ns).map_err(failure)
}

fn numbered(request: u32) -> Result<Request, Failure> {
    let found = Request::from_number(request);
    found.ok_or_else(|| Failure::new(HEXAD_INVALID, format!("no request is {request}")))
}

fn failure(error: OperatorError) -> Failure {
    Failure::new(result(&error), error)
}

/// What a failure means here.
fn result(error: &OperatorError) -> hexad_result {
    match error {
        OperatorError::NoDaemon(_) | OperatorError::NotTrusted { .. } => HEXAD_NO_DAEMON,
        OperatorError::Forbidden { .. } => HEXAD_FORBIDDEN,
        OperatorError::Refused(..) | OperatorError::Stale(..) => HEXAD_REFUSED,
        OperatorError::NotCompleted(..) => HEXAD_NOT_COMPLETED,
        OperatorError::TimedOut(..) | OperatorError::NotConfirmed(..) => HEXAD_TIMED_OUT,
        _ => HEXAD_INTERNAL,
    }
}
