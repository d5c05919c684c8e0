//! `hexad engage | stop | park | clear | off | estop`: an operator's request and its outcome.
//!
//! A request is sent until the daemon answers it; then its outcome is waited for. A command that ends with 0 has
//! reached its state.

use core::fmt;
use core::time::Duration;
use std::thread;
use std::time::Instant;

use nalgebra::Vector3;

use crate::config::Config;
use crate::control::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::state::{Request, State};
use crate::messages::clock::monotonic_ns;
use crate::messages::{Bus, CommandMessage, PortError, Publisher, StatusMessage, Subscriber};
use crate::realtime::stop_request::Stop;

/// How often the status is polled.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// How often the request is repeated: a message is lost if the daemon is not connected yet.
const REPEAT_INTERVAL: Duration = Duration::from_millis(100);

/// Without a status for this long, no daemon runs.
const STATUS_TIMEOUT: Duration = Duration::from_secs(2);

/// Why a request was not carried out.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error("no daemon runs for {0}: no status for {STATUS_TIMEOUT:?}")]
    NoStatus(String),
    #[error("{request} was refused: {refusal}", request = .0.name(), refusal = .1)]
    Refused(Request, Refusal),
    #[error("{request} was not completed: the daemon is in {state}: {reason}", request = .0.name(), state = .1.name(), reason = .2)]
    OtherState(Request, State, Diagnostic),
    #[error("{request} was not completed within {1} s: the daemon is in {state}: {reason}", request = .0.name(), state = .2.name(), reason = .3)]
    Timeout(Request, f64, State, Diagnostic),
    #[error("interrupted")]
    Interrupted,
}

/// Diagnostic of a refused request, with the state that refused it.
#[derive(Clone, Copy, Debug)]
pub struct Refusal {
    request: Diagnostic,
    state: State,
    /// Diagnostic of the state.
    current: Diagnostic,
    /// From the platform to the setpoint \[m\], \[rad\], if both are known.
    distance: Option<(f64, f64)>,
}

impl Refusal {
    fn new(status: &StatusMessage) -> Self {
        let norm = |v: [f64; 3]| Vector3::from(v).norm();
        let distance = (norm(status.position_error_m), norm(status.orientation_error_rad));
        Self {
            request: status.request_diagnostic.diagnostic().unwrap_or_default(),
            state: status.state().unwrap_or_default(),
            current: status.diagnostic.diagnostic().unwrap_or_default(),
            distance: (status.error_valid == 1).then_some(distance),
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { request, state, current, distance } = self;
        match (request.code, state, distance) {
            (DiagnosticCode::InvalidInState, State::Fault, _) => {
                write!(f, "not possible in state fault ({}); hexad clear first", current.code.name())
            }
            (DiagnosticCode::InvalidInState, ..) => write!(f, "not possible in state {}", state.name()),
            (DiagnosticCode::SetpointTooFar, _, Some((position, orientation))) => {
                write!(f, "{request} ({:.3} mm and {:.3} mrad away)", position * 1e3, orientation * 1e3)
            }
            _ => write!(f, "{request}"),
        }
    }
}

/// Sender of operator requests, with the daemon's status.
pub struct Operator {
    commands: Publisher<CommandMessage>,
    statuses: Subscriber<StatusMessage>,
    is_simulated: bool,
    /// Of the newest status \[ns\]: in simulated time, that is now.
    status_ns: u64,
}

/// A request that is to be carried out.
#[derive(Clone, Copy, Debug)]
pub struct Order {
    pub request: Request,
    /// Whether to wait for measurements and setpoint where they are missing, instead of being refused.
    pub is_patient: bool,
    pub timeout: Duration,
}

impl Operator {
    /// Joins the topics of a machine.
    pub fn new(bus: &Bus) -> Result<Self, PortError> {
        let (commands, statuses) = (bus.publisher()?, bus.subscriber(8)?);
        Ok(Self { commands, statuses, is_simulated: bus.is_simulated(), status_ns: 0 })
    }

    /// Sends a request, without waiting for its outcome.
    pub fn send(&mut self, request: Request) -> Result<(), PortError> {
        let now_ns = if self.is_simulated { self.status_ns } else { monotonic_ns() };
        self.commands.publish(now_ns, request.into())
    }

    /// The newest status, if one arrived since the last call.
    pub fn status(&mut self) -> Option<StatusMessage> {
        let status = self.statuses.receive_latest();
        self.status_ns = status.map_or(self.status_ns, |status| status.header.time_ns);
        status
    }

    /// Sends a request to the daemon of `machine` and waits until it is carried out; the state it led to.
    pub fn carry_out(&mut self, machine: &str, order: &Order, stop: &Stop) -> Result<State, OperatorError> {
        let Order { request, timeout, .. } = *order;
        let began = Instant::now();
        let mut sent: Option<Instant> = None;
        let mut last_status = Instant::now();
        let mut is_accepted = false;
        let (mut state, mut reason) = (State::default(), Diagnostic::default());
        let first = self.commands.next_message();
        loop {
            if !is_accepted && sent.is_none_or(|sent| sent.elapsed() > REPEAT_INTERVAL) {
                self.send(request)?;
                sent = Some(Instant::now());
            }
            if let Some(status) = self.status() {
                last_status = Instant::now();
                state = status.state().unwrap_or_default();
                reason = status.diagnostic.diagnostic().unwrap_or_default();
                is_accepted = is_accepted || order.is_accepted(&status, first)?;
                match order.outcome(state).filter(|_| is_accepted) {
                    Some(true) => return Ok(state),
                    Some(false) => return Err(OperatorError::OtherState(request, state, reason)),
                    None => {}
                }
            }
            if stop.is_requested() {
                return Err(OperatorError::Interrupted);
            }
            if last_status.elapsed() > STATUS_TIMEOUT {
                return Err(OperatorError::NoStatus(machine.into()));
            }
            if began.elapsed() > timeout {
                return Err(OperatorError::Timeout(request, timeout.as_secs_f64(), state, reason));
            }
            thread::sleep(POLL_INTERVAL);
        }
    }
}

impl Order {
    /// Whether the daemon has accepted the request, of which `first` is the first message; an error if it has refused it
    /// for good.
    fn is_accepted(&self, status: &StatusMessage, first: (u64, u64)) -> Result<bool, OperatorError> {
        let is_answered = status.request_epoch == first.0 && status.request_sequence >= first.1;
        if !is_answered {
            return Ok(false);
        }
        let refusal = Refusal::new(status);
        let code = refusal.request.code;
        // Only an operator ends a fault.
        let may_be_accepted = self.is_patient && may_resolve(code) && refusal.state != State::Fault;
        match code {
            DiagnosticCode::None => Ok(true),
            _ if may_be_accepted => Ok(false),
            _ => Err(OperatorError::Refused(self.request, refusal)),
        }
    }

    /// Whether a state is the one that the accepted request leads to; `None` on the way there.
    fn outcome(&self, state: State) -> Option<bool> {
        match (self.request, state) {
            (Request::Engage, State::Engaging) => None,
            (Request::Engage, state) => Some(state == State::Active),
            (Request::Stop | Request::Park, State::Stopping) | (Request::Park, State::Parking) => None,
            (Request::Stop, state) => Some(!state.has_control() && state != State::Fault),
            (Request::Park, state) => Some(state == State::Off),
            // A fault stays one, and has no force either.
            (Request::Off, state) => Some(!state.has_control()),
            (Request::Clear, state) => Some(state != State::Fault),
            (Request::Estop, state) => Some(state == State::Fault),
        }
    }
}

/// Whether the reason of a refusal may disappear without a correction: a source that was lost may be about to return.
fn may_resolve(code: DiagnosticCode) -> bool {
    !code.is_fault() || matches!(code, DiagnosticCode::SetpointLost | DiagnosticCode::MeasurementLost)
}

/// Sends the request and waits for its outcome.
pub fn run(config: &Config, order: &Order, stop: &Stop) -> Result<State, OperatorError> {
    let bus = config.join()?;
    Operator::new(&bus)?.carry_out(&config.name, order, stop)
}
