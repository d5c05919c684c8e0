//! Operators' requests to the daemons of this host: commands, libhexad and panels send them from here.
//!
//! A request goes over the control socket, as a line of [`protocol`], and the daemon's answer comes back. What stops is sent first and
//! judged afterwards ([`stops`]); everything else goes to one daemon that counts ([`requests`]). Whose answers count says
//! [`endpoint`]. A stop whose socket does not answer goes by signal ([`signal`]).

use std::time::Duration;

use self::connection::Connection;
use self::endpoint::Endpoint;
use self::users::user_name;
use crate::control::signals::state::Request;

pub mod connection;
pub mod endpoint;
mod exchange;
pub mod protocol;
pub mod requests;
pub mod signal;
pub mod status_report;
pub mod stops;
pub mod users;

/// Time between two attempts.
const RETRY_INTERVAL: Duration = Duration::from_millis(2);

/// Attempts of a request whose connection the daemon has closed, as it does when too many clients connect.
const ATTEMPTS: u32 = 5;

/// Why a request was not carried out.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    /// Nobody listens, and no process is recorded.
    #[error("no daemon runs for {0}: none listens in /run/hexad or in a folder of a user")]
    NoDaemon(String),
    /// No machine runs at all.
    #[error("no daemon runs on this host")]
    NoMachine,
    /// The machine is ambiguous.
    #[error("several machines run: {0}; name one, or give --all")]
    Several(String),
    /// A daemon runs, but this user may not send it requests.
    #[error("this user may not send requests for {machine} ({socket}): {allowed}")]
    Forbidden {
        /// Name of the machine.
        machine: String,
        /// Path of the control socket.
        socket: String,
        /// Who may, in words.
        allowed: String,
    },
    /// Only daemons run whose answers do not count.
    #[error(
        "{request} is not confirmed: {stranger}; only daemons of the service, of root and of this user count. Run it as that user, or \
         the daemon as a service, whose [operator] group admits others"
    )]
    NotTrusted {
        /// The request.
        request: String,
        /// One of the daemons.
        stranger: Stranger,
    },
    /// The daemon refuses it.
    #[error("{request} was refused: {reason}", request = .0.name(), reason = .1)]
    Refused(Request, String),
    /// It was accepted, and control went elsewhere.
    #[error("{request} was not completed: {reason}", request = .0.name(), reason = .1)]
    NotCompleted(Request, String),
    /// Its state was not reached in its time \[s\].
    #[error("{request} was not completed within {1} s: {reason}", request = .0.name(), reason = .2)]
    TimedOut(Request, f64, String),
    /// It is unknown whether the request was carried out.
    #[error("{request} is not confirmed: {reason}", request = .0.name(), reason = .1)]
    NotConfirmed(Request, String),
    /// The daemon was held, and it may be old.
    #[error("{request} was not carried out: {reason}", request = .0.name(), reason = .1)]
    Stale(Request, String),
    /// The daemon does not answer.
    #[error("the daemon does not answer: {0}")]
    NoAnswer(String),
    /// The daemon refuses its machine file.
    #[error("reload was refused, nothing has changed:\n{0}")]
    ReloadRefused(String),
    /// It is unknown whether the machine file was reloaded.
    #[error("reload is not confirmed: {0}")]
    ReloadNotConfirmed(String),
    /// The last seconds were not written.
    #[error("the daemon has not written its last seconds: {0}")]
    NotRecorded(String),
    /// The caller has given up.
    #[error("interrupted")]
    Interrupted,
}

impl OperatorError {
    fn forbidden_at(endpoint: &Endpoint) -> Self {
        Self::Forbidden {
            machine: endpoint.machine.clone(),
            socket: endpoint.socket.display().to_string(),
            allowed: endpoint.allowed(),
        }
    }
}

/// A daemon that does not count, and what it said.
#[derive(Clone, Debug, thiserror::Error)]
#[error("the daemon of user {owner} at {socket} does not count ({said})")]
pub struct Stranger {
    owner: String,
    socket: String,
    said: String,
}

impl Stranger {
    fn at(endpoint: &Endpoint, connection: &Connection, said: &str) -> Self {
        let owner = connection.user_id().unwrap_or(endpoint.owner);
        let socket = endpoint.socket.display().to_string();
        Self { owner: user_name(owner), socket, said: said.into() }
    }

    fn error(self, request: &str) -> OperatorError {
        OperatorError::NotTrusted { request: request.into(), stranger: self }
    }
}

/// A request that is to be carried out.
#[derive(Clone, Copy, Debug)]
pub struct Order {
    /// What is requested.
    pub request: Request,
    /// Whether to wait for measurements and setpoint where they are missing, instead of being refused.
    pub is_patient: bool,
    /// Longest wait for the outcome.
    pub timeout: Duration,
}
