//! Stopping by signal, where the control socket does not answer: SIGUSR1 is `estop`, SIGUSR2 `stop`.
//!
//! There is no signal for `off`; it becomes an emergency stop, which disables the forces just as fast and lasts until
//! `clear`. Confirmed is what the daemon reports itself afterwards: over the socket, or by its status messages.

use std::thread::sleep;
use std::time::{Duration, Instant};

use super::endpoint::{Attempt, Endpoint};
use crate::config::identity::Identity;
use crate::control::state::{Request, State};
use crate::daemon::control_socket::protocol::RequestLine;
use crate::daemon::control_socket::user_name;
use crate::daemon::request_of;
use crate::messages::clock::monotonic_ns;
use crate::messages::location::user_id;
use crate::messages::{StatusMessage, Subscriber};
use crate::realtime::request_signal::RequestSignal;

/// Longest wait for an emergency stop to be confirmed; a `stop` takes its time, the command's own limit.
const CONFIRMATION_LIMIT: Duration = Duration::from_secs(2);
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Longest wait for one answer of the socket: it is asked again.
const SOCKET_LIMIT: Duration = Duration::from_millis(100);

/// Result of a signal.
pub enum Signalled {
    /// The daemon has reported a state that the request leads to.
    Confirmed {
        state: String,
        way: String,
    },
    Unconfirmed(String),
}

/// Sends a signal to the daemon and waits until the daemon reports that it is carried out.
pub fn send(
    machine: &Identity,
    request: Request,
    endpoint: &Endpoint,
    process_id: u32,
    timeout: Duration,
) -> Signalled {
    let signal = if request == Request::Stop { RequestSignal::User2 } else { RequestSignal::User1 };
    let carried_out = request_of(signal);
    // Before the signal. Another user's messages are not seen, but the socket may still answer.
    let is_own = endpoint.daemon.as_ref().is_some_and(|daemon| daemon.user_id == user_id());
    let join = || machine.join().and_then(|bus| bus.subscriber::<StatusMessage>(8)).ok();
    let mut statuses = if is_own { join() } else { None };
    let sent_ns = monotonic_ns();
    if let Err(error) = signal.send(process_id) {
        let owner = endpoint.daemon.as_ref().map_or_else(|| "its user".into(), |it| user_name(it.user_id));
        return Signalled::Unconfirmed(format!(
            "{} does not answer, and process {process_id} cannot be signalled ({error}): {owner} and root may",
            endpoint.socket.display()
        ));
    }
    let sent = format!(
        "{} did not answer; {} by SIG{} to process {process_id}",
        endpoint.socket.display(),
        carried_out.name(),
        signal.name()
    );
    let until = Instant::now() + if carried_out == Request::Stop { timeout } else { CONFIRMATION_LIMIT };
    while Instant::now() < until {
        if let Some(state) =
            reported(statuses.as_mut(), sent_ns).filter(|state| is_reached(carried_out, *state))
        {
            let way = format!("{sent}, confirmed by the status messages");
            return Signalled::Confirmed { state: state.name().into(), way };
        }
        if statuses.is_none()
            && let Some(state) = asked(endpoint).filter(|state| is_reached(carried_out, *state))
        {
            let way = format!("{sent}, confirmed by the control socket afterwards");
            return Signalled::Confirmed { state: state.name().into(), way };
        }
        sleep(POLL_INTERVAL);
    }
    Signalled::Unconfirmed(format!(
        "{sent}, and it has not reported the result: use the emergency-stop circuit"
    ))
}

/// State of the newest status message since the signal.
fn reported(statuses: Option<&mut Subscriber<StatusMessage>>, sent_ns: u64) -> Option<State> {
    let status = statuses?.receive_latest()?;
    status.state().filter(|_| status.header.time_ns > sent_ns)
}

/// State that the control socket reports.
fn asked(endpoint: &Endpoint) -> Option<State> {
    let Attempt::Connected(mut connection) = endpoint.connect().ok()? else { return None };
    connection.send(&RequestLine::new("status")).ok()?;
    let answer = connection.receive(Instant::now() + SOCKET_LIMIT, || false).ok()??;
    State::ALL.into_iter().find(|state| state.name() == answer.state)
}

fn is_reached(request: Request, state: State) -> bool {
    match request {
        Request::Estop => state == State::Fault,
        _ => !state.has_control(),
    }
}
