//! The emergency stop by signal, where the control socket does not answer: SIGUSR1, as `hexad estop` does it.

use std::io;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::control::state::State;
use hexad::messages::claim::RunningDaemon;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::location::user_id;
use hexad::messages::{Bus, StatusMessage, Subscriber};

use crate::outcome::hexad_result::{HEXAD_FORBIDDEN, HEXAD_OK, HEXAD_TIMED_OUT};
use crate::outcome::{Failure, Outcome};
use crate::request::state_of;

/// Longest wait for the daemon to report that it has stopped, as of `hexad estop`.
const CONFIRMATION_LIMIT: Duration = Duration::from_secs(2);
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Signals the first of these daemons that this user may signal, and waits until it reports the stop; `otherwise` if there
/// is no daemon.
pub fn emergency_stop(daemons: &[RunningDaemon], otherwise: Failure) -> Outcome {
    let mut failure = otherwise;
    for daemon in daemons {
        // Before the signal: the report must not be missed.
        let mut statuses = subscribe(daemon);
        let sent_ns = monotonic_ns();
        match signal(daemon.process_id) {
            Ok(()) => return confirm(daemon, statuses.as_mut(), sent_ns),
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
                let text = format!(
                    "{} does not answer, and this user may not signal process {}",
                    daemon.socket.display(),
                    daemon.process_id
                );
                failure = Failure::new(HEXAD_FORBIDDEN, text);
            }
            // It has ended.
            Err(_) => {}
        }
    }
    Err(failure)
}

fn signal(process_id: u32) -> io::Result<()> {
    let process_id = libc::pid_t::try_from(process_id).map_err(io::Error::other)?;
    // SAFETY: plain numbers. A process that has ended makes the call fail.
    let result = unsafe { libc::kill(process_id, libc::SIGUSR1) };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Status messages of a daemon of this user; those of others are not seen.
fn subscribe(daemon: &RunningDaemon) -> Option<Subscriber<StatusMessage>> {
    let is_own = daemon.user_id == user_id();
    is_own.then(|| Bus::join(&daemon.machine).and_then(|bus| bus.subscriber(8)).ok()).flatten()
}

/// Waits for the state that the emergency stop leads to: by the status messages, else by the socket, should it answer again.
fn confirm(
    daemon: &RunningDaemon,
    mut statuses: Option<&mut Subscriber<StatusMessage>>,
    sent_ns: u64,
) -> Outcome {
    let until = Instant::now() + CONFIRMATION_LIMIT;
    while Instant::now() < until {
        let state = match &mut statuses {
            Some(statuses) => statuses
                .receive_latest()
                .filter(|status| status.header.time_ns > sent_ns)
                .and_then(|status| status.state()),
            None => state_of(&daemon.socket),
        };
        if state == Some(State::Fault) {
            return Ok(HEXAD_OK);
        }
        sleep(POLL_INTERVAL);
    }
    let text = format!(
        "{} did not answer; estop by SIGUSR1 to process {}, and it has not reported the result: use the emergency-stop circuit",
        daemon.socket.display(),
        daemon.process_id
    );
    Err(Failure::new(HEXAD_TIMED_OUT, text))
}
