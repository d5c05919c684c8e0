//! `hexad engage | stop | park | clear | off | estop`: an operator's request, and what became of it.
//!
//! A request is sent until the daemon answers it, and then its outcome is waited for: a command that ends
//! with 0 has done what it says.

use core::fmt;
use core::time::Duration;
use std::thread;
use std::time::Instant;

use crate::config::Config;
use crate::control::diagnostic::DiagnosticCode;
use crate::control::state::{Request, State};
use crate::messages::clock::monotonic_ns;
use crate::messages::ports::{Bus, PortError, Sink, Source, Time};
use crate::messages::structs::{CommandMessage, StatusMessage};
use crate::realtime::stop_request::Stop;

/// How often to look for an answer.
const POLL: Duration = Duration::from_millis(2);

/// How often to ask again: a message is lost if nobody is connected yet.
const REPEAT: Duration = Duration::from_millis(100);

/// A daemon that has not said a word for this long is not there.
const SILENCE: Duration = Duration::from_secs(2);

/// Why a request was not carried out.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error("no daemon runs for {0}: no status for {SILENCE:?}")]
    Silent(String),
    #[error("{request} was refused: {reason}", request = .0.name(), reason = .1)]
    Refused(Request, Reason),
    #[error("{request} was not completed: the daemon is in {state}: {reason}", request = .0.name(), state = .1.name(), reason = .2)]
    Otherwise(Request, State, Reason),
    #[error("{request} was not completed within {1} s: the daemon is in {state}: {reason}", request = .0.name(), state = .2.name(), reason = .3)]
    TooLong(Request, f64, State, Reason),
    #[error("interrupted")]
    Interrupted,
}

/// A cause, with what the status says about it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reason {
    cause: DiagnosticCode,
    /// What the daemon is in, and why.
    state: State,
    state_cause: DiagnosticCode,
    /// \[m\], \[rad\], where they say something.
    distance: Option<(f64, f64)>,
}

impl Reason {
    fn new(cause: DiagnosticCode, status: &StatusMessage) -> Self {
        let norm = |v: [f64; 3]| nalgebra::Vector3::from(v).norm();
        let distance = (norm(status.position_error_m), norm(status.orientation_error_rad));
        let told = cause == DiagnosticCode::SetpointTooFar && status.error_valid == 1;
        Self {
            cause,
            state: State::from_number(status.state).unwrap_or_default(),
            state_cause: DiagnosticCode::from_number(status.fault).unwrap_or_default(),
            distance: told.then_some(distance),
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.cause == DiagnosticCode::InvalidInState {
            write!(f, "not possible in state {}", self.state.name())?;
            return match self.state {
                State::Fault => write!(f, " ({}); hexad clear first", self.state_cause.name()),
                _ => Ok(()),
            };
        }
        write!(f, "{}", self.cause.name())?;
        if let Some((position, orientation)) = self.distance {
            write!(f, ": {:.3} mm and {:.3} mrad away", position * 1e3, orientation * 1e3)?;
        }
        write!(f, "; {}", self.cause.remedy())
    }
}

/// Sends requests and reads what comes of them.
pub struct Operator {
    commands: Source<CommandMessage>,
    statuses: Sink<StatusMessage>,
    time: Time,
    /// The first message of the present request.
    first: (u64, u64),
    /// Of the newest status \[ns\]: in simulated time, that is now.
    heard_ns: u64,
}

impl Operator {
    /// Joins the topics of a machine.
    pub fn new(bus: &Bus) -> Result<Self, PortError> {
        let (commands, statuses) = (bus.source()?, bus.sink(8)?);
        Ok(Self { commands, statuses, time: bus.time(), first: (u64::MAX, 0), heard_ns: 0 })
    }

    /// Sends a request, without waiting.
    pub fn ask(&mut self, request: Request) -> Result<(), PortError> {
        let message = CommandMessage { request: request as u32, ..CommandMessage::default() };
        let now_ns = match self.time {
            Time::Real => monotonic_ns(),
            Time::Simulated => self.heard_ns,
        };
        self.commands.publish(now_ns, message)
    }

    /// The newest status, if one came since the last call.
    pub fn status(&mut self) -> Option<StatusMessage> {
        let newest = self.statuses.newest();
        self.heard_ns = newest.map_or(self.heard_ns, |status| status.header.time_ns);
        newest
    }

    /// Sends a request and waits until it is carried out. `is_patient` waits for what engaging needs, too.
    pub fn carry_out(
        &mut self,
        machine: &str,
        request: Request,
        is_patient: bool,
        longest: Duration,
        stop: &Stop,
    ) -> Result<State, OperatorError> {
        let began = Instant::now();
        let mut asked: Option<Instant> = None;
        let mut heard = Instant::now();
        let mut accepted = false;
        let (mut state, mut reason) = (State::default(), Reason::default());
        self.first = self.commands.next_message();
        loop {
            if !accepted && asked.is_none_or(|asked| asked.elapsed() > REPEAT) {
                self.ask(request)?;
                asked = Some(Instant::now());
            }
            if let Some(status) = self.status() {
                heard = Instant::now();
                state = State::from_number(status.state).unwrap_or_default();
                reason = Reason::new(DiagnosticCode::from_number(status.fault).unwrap_or_default(), &status);
                if (status.answered_epoch, status.answered_sequence) >= self.first
                    && status.answered_epoch == self.first.0
                {
                    match DiagnosticCode::from_number(status.refused).unwrap_or_default() {
                        DiagnosticCode::None => accepted = true,
                        _ if accepted => {}
                        // Nobody else leaves a fault.
                        cause if is_patient && may_come(cause) && state != State::Fault => {}
                        cause => return Err(OperatorError::Refused(request, Reason::new(cause, &status))),
                    }
                }
                if accepted && let Some(reached) = outcome(request, state) {
                    return if reached {
                        Ok(state)
                    } else {
                        Err(OperatorError::Otherwise(request, state, reason))
                    };
                }
            }
            if stop.is_requested() {
                return Err(OperatorError::Interrupted);
            }
            if heard.elapsed() > SILENCE {
                return Err(OperatorError::Silent(machine.into()));
            }
            if began.elapsed() > longest {
                return Err(OperatorError::TooLong(request, longest.as_secs_f64(), state, reason));
            }
            thread::sleep(POLL);
        }
    }
}

/// Whether what is lacking may come without anybody's correction: who was lost may be about to come back.
fn may_come(cause: DiagnosticCode) -> bool {
    !cause.is_fault() || matches!(cause, DiagnosticCode::SetpointLost | DiagnosticCode::MeasurementLost)
}

/// Whether a state is what an accepted request was to lead to; `None` while it is on the way.
fn outcome(request: Request, state: State) -> Option<bool> {
    match (request, state) {
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

/// The command: asks, waits, and knows what came of it.
pub fn run(
    config: &Config,
    request: Request,
    is_patient: bool,
    longest: Duration,
    stop: &Stop,
) -> Result<State, OperatorError> {
    let bus = config.join()?;
    Operator::new(&bus)?.carry_out(&config.name, request, is_patient, longest, stop)
}
