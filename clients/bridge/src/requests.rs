//! Operators' requests from a network: their names in files, and the way to the daemon.

use std::time::Duration;

use hexad_client::operator::protocol::is_stop;
use hexad_client::operator::requests::carry_out;
use hexad_client::operator::stops::stop_machine;
use hexad_client::operator::{OperatorError, Order};
use hexad_core::control::signals::state::Request;

/// Longest wait for the result of a request.
const TIMEOUT: Duration = Duration::from_secs(30);

/// The requests that end control or force.
pub const STOPS: [Request; 3] = [Request::Stop, Request::Off, Request::Estop];

/// Requests of the names in a list; an error names the first that is none.
pub fn requests_of_names(names: &[String]) -> Result<Vec<Request>, String> {
    let unknown = |name: &String| {
        format!("requests: \"{name}\" must be one of {}", Request::ALL.map(Request::name).join(", "))
    };
    names.iter().map(|name| Request::by_name(name).ok_or_else(|| unknown(name))).collect()
}

/// Carries out a request of a remote side, which the log of the daemon names. Returns the name of the resulting state.
pub fn carry_out_for(machine: &str, request: Request, remote: &str) -> Result<String, OperatorError> {
    let order = Order { remote: Some(remote), ..Order::new(request, TIMEOUT) };
    if is_stop(request) {
        stop_machine(machine, &order, &|| false)
    } else {
        carry_out(machine, &order, &|| false, |_| ())
    }
}
