//! Operators' requests to the daemons of this host. Commands, libhexad and panels use this module.
//!
//! A request is a line of [`protocol`] over the control socket, and the daemon's answer comes back. A stop is
//! sent to all daemons of a machine first and evaluated afterwards ([`stops`]). Every other request goes to
//! one daemon that counts ([`requests`]). [`endpoint`] defines whose answers count. If the socket does not
//! answer, a stop is sent by signal ([`signal`]).

use std::time::Duration;

use self::connection::Connection;
use self::endpoint::Endpoint;
use self::requests::StopBaseline;
use self::users::user_name;
use hexad_core::control::signals::state::Request;

pub mod connection;
pub mod endpoint;
mod exchange;
pub mod motion_fields;
pub mod protocol;
pub mod requests;
pub mod ride;
pub mod signal;
pub mod status_report;
pub mod stops;
pub mod users;

/// Time between two attempts.
const RETRY_INTERVAL: Duration = Duration::from_millis(2);

/// Attempts of a request whose connection the daemon closes, which it does if too many clients connect.
const ATTEMPTS: u32 = 5;

/// Reason why a request was not carried out.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    /// No process listens, and none is recorded.
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
        /// Users who may, as text.
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
        stranger: UntrustedDaemon,
    },
    /// The daemon refuses it.
    #[error("{request} was refused: {reason}", request = .0.name(), reason = .1)]
    Refused(Request, String),
    /// It was accepted, but control ended otherwise.
    #[error("{request} was not completed: {reason}", request = .0.name(), reason = .1)]
    NotCompleted(Request, String),
    /// Its state was not reached within its time \[s\].
    #[error("{request} was not completed within {1} s: {reason}", request = .0.name(), reason = .2)]
    TimedOut(Request, f64, String),
    /// It is unknown whether the request was carried out.
    #[error("{request} is not confirmed: {reason}", request = .0.name(), reason = .1)]
    NotConfirmed(Request, String),
    /// The daemon was held, and the request may be from before.
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

/// A daemon that does not count, and its answer.
#[derive(Clone, Debug, thiserror::Error)]
#[error("the daemon of user {owner} at {socket} does not count ({said})")]
pub struct UntrustedDaemon {
    owner: String,
    socket: String,
    said: String,
}

impl UntrustedDaemon {
    fn at(endpoint: &Endpoint, connection: &Connection, said: &str) -> Self {
        let owner = connection.peer_user_id().unwrap_or(endpoint.owner);
        let socket = endpoint.socket.display().to_string();
        Self { owner: user_name(owner), socket, said: said.into() }
    }

    fn error(self, request: &str) -> OperatorError {
        OperatorError::NotTrusted { request: request.into(), stranger: self }
    }
}

/// A request with its options.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The request.
    pub request: Request,
    /// Whether to wait for missing measurements and setpoints instead of being refused.
    pub is_patient: bool,
    /// Longest wait for the result.
    pub timeout: Duration,
    /// Remote side for which a bridge sends the request, for the log of the daemon.
    pub remote: Option<&'a str>,
    /// When a person asked; `None` for when the request is sent.
    pub baseline: Option<StopBaseline>,
    /// Number of the pose that the operator selects from the list of a refusal.
    pub pose: Option<u32>,
}

impl Order<'_> {
    /// A request that is asked for when it is sent, and does not wait for anything that is missing.
    pub fn new(request: Request, timeout: Duration) -> Self {
        Self { request, is_patient: false, timeout, remote: None, baseline: None, pose: None }
    }
}
