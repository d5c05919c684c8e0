//! Stops by signal, used if the control socket does not answer: SIGUSR1 is `estop`, SIGUSR2 is `stop`.
//!
//! There is no signal for `off`. It is sent as an emergency stop, which disables the forces equally fast and
//! lasts until `clear`. A stop is confirmed if the daemon then reports its state: over the socket, or by its
//! status messages.
//!
//! The signal is sent to a process descriptor, not to a process ID, which may belong to another process by
//! now. A process without a handler for SIGUSR1 would be killed.

#![allow(unsafe_code, reason = "the system calls have no safe interface; each block carries its argument")]

use core::ffi::c_int;
use core::ptr;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::connection::{Attempt, Connection};
use super::endpoint::Endpoint;
use super::protocol::RequestLine;
use super::users::user_name;
use crate::messages::claim::start_ticks_since_boot;
use crate::messages::clock::monotonic_ns;
use crate::messages::{Bus, StatusMessage, Subscriber};
use hexad_core::control::signals::state::{Request, State};

/// Longest wait for the confirmation of an emergency stop. For a `stop` it is the limit of the command.
const CONFIRMATION_LIMIT: Duration = Duration::from_secs(2);
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Longest wait for one answer of the socket. After it the request is sent again.
const SOCKET_LIMIT: Duration = Duration::from_millis(100);

/// Signal that posts a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestSignal {
    /// SIGUSR1.
    User1,
    /// SIGUSR2.
    User2,
}

impl RequestSignal {
    /// The signal for a request that stops.
    fn of(request: Request) -> Self {
        if request == Request::Stop { Self::User2 } else { Self::User1 }
    }

    /// Request that the signal posts in a daemon.
    pub fn request(self) -> Request {
        match self {
            Self::User1 => Request::Estop,
            Self::User2 => Request::Stop,
        }
    }

    /// Name for messages and for `kill -s`.
    pub fn name(self) -> &'static str {
        match self {
            Self::User1 => "USR1",
            Self::User2 => "USR2",
        }
    }

    /// Signal number.
    pub fn number(self) -> c_int {
        match self {
            Self::User1 => libc::SIGUSR1,
            Self::User2 => libc::SIGUSR2,
        }
    }
}

/// A process by descriptor, which remains correct if its process ID is used again.
pub(super) struct Process {
    pub id: u32,
    descriptor: OwnedFd,
}

impl Process {
    /// The daemon of an endpoint: the process that listens there, else the recorded one.
    pub fn of(endpoint: &Endpoint, connection: Option<&Connection>) -> Option<Self> {
        let listening =
            connection.and_then(|it| Some(Self { id: it.peer_process_id()?, descriptor: it.process()? }));
        listening.or_else(|| {
            let recorded = endpoint.daemon.as_ref()?;
            let opened = Self { id: recorded.process_id, descriptor: open(recorded.process_id).ok()? };
            // Checked after it is opened: from now on the descriptor refers to this process.
            (start_ticks_since_boot(opened.id).ok()? == recorded.start_ticks).then_some(opened)
        })
    }

    fn send(&self, signal: RequestSignal) -> io::Result<()> {
        let no_information = ptr::null::<libc::siginfo_t>();
        // SAFETY: a descriptor that is open, plain numbers, and no information, which is allowed.
        let result = unsafe {
            libc::syscall(
                libc::SYS_pidfd_send_signal,
                self.descriptor.as_raw_fd(),
                signal.number(),
                no_information,
                0,
            )
        };
        if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
    }
}

fn open(process_id: u32) -> io::Result<OwnedFd> {
    // SAFETY: plain numbers.
    let opened = unsafe { libc::syscall(libc::SYS_pidfd_open, process_id, 0) };
    let opened = c_int::try_from(opened).ok().filter(|opened| *opened >= 0);
    // SAFETY: the kernel has just opened it for this process.
    opened.map(|opened| unsafe { OwnedFd::from_raw_fd(opened) }).ok_or_else(io::Error::last_os_error)
}

/// Result of a signal.
pub(super) enum Signalled {
    /// A state that the request leads to, and the way of confirmation.
    Confirmed {
        state: String,
        way: String,
    },
    Unconfirmed(String),
}

/// Sends a signal to the daemon, and waits until the daemon reports the result.
pub(super) fn send(request: Request, endpoint: &Endpoint, process: &Process, timeout: Duration) -> Signalled {
    let (signal, socket) = (RequestSignal::of(request), endpoint.socket.display());
    let carried_out = signal.request();
    // Joined before the signal is sent. Another user's messages are not visible, but the socket may still
    // answer.
    let join = || {
        Bus::join_at_once(&endpoint.machine, false).and_then(|bus| bus.subscriber::<StatusMessage>(8)).ok()
    };
    let mut statuses = endpoint.is_own().then(join).flatten();
    let sent_ns = monotonic_ns();
    if let Err(error) = process.send(signal) {
        return Signalled::Unconfirmed(format!(
            "{socket} does not answer, and process {} cannot be signalled ({error}): {} and root may",
            process.id,
            user_name(endpoint.owner)
        ));
    }
    let sent = format!(
        "{socket} did not answer; {} by SIG{} to process {}",
        carried_out.name(),
        signal.name(),
        process.id
    );
    let until = Instant::now() + if carried_out == Request::Stop { timeout } else { CONFIRMATION_LIMIT };
    let reaches = |state: &State| match carried_out {
        Request::Estop => *state == State::Fault,
        _ => !state.has_control(),
    };
    while Instant::now() < until {
        let reported = reported(statuses.as_mut(), sent_ns).map(|state| (state, "status messages"));
        let found = reported.or_else(|| Some((asked(endpoint)?, "control socket afterwards")));
        if let Some((state, by)) = found.filter(|(state, _)| reaches(state)) {
            return Signalled::Confirmed {
                state: state.name().into(),
                way: format!("{sent}, confirmed by the {by}"),
            };
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
    State::by_name(&answer.state).filter(|_| endpoint.counts(&connection))
}
