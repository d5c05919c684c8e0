//! Requests to one daemon: the first that counts, in the order service, this user, root.

use std::io;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::connection::{Attempt, Connection};
use super::endpoint::{Endpoint, endpoints};
use super::exchange::converse;
use super::protocol::{AnswerLine, MAX_REQUEST_AGE_NS, RequestLine, RequestResult, STOPPED};
use super::ride::{RideOrder, RidePhase};
use super::status_report::StopNumber;
use super::{ATTEMPTS, OperatorError, Order, RETRY_INTERVAL, UntrustedDaemon};
use hexad_core::control::signals::state::Request;

/// Longest wait for the first line of the daemon: longer than the daemon waits for its loop.
const FIRST_LINE_LIMIT: Duration = Duration::from_secs(3);

/// Longest wait for a cycle in simulated time: a day, as a participant may be held.
const CYCLE_LIMIT: Duration = Duration::from_secs(86_400);

/// Longest wait of a patient request for a daemon that is about to start.
const DAEMON_START_LIMIT: Duration = Duration::from_secs(2);

/// Sends a request other than a stop, and waits for its result: the name of the resulting state. `waits`
/// receives the reasons for waiting, each once. A patient request also waits for a daemon that is about to
/// start.
pub fn carry_out(
    machine: &str,
    order: &Order,
    interrupted: &(dyn Fn() -> bool + Sync),
    mut waits: impl FnMut(&str),
) -> Result<String, OperatorError> {
    let began = Instant::now();
    let can_begin = order.request.can_begin_control();
    let mut baseline = can_begin.then(|| order.baseline.unwrap_or_else(|| StopBaseline::now(machine)));
    loop {
        let stops = baseline.as_mut().and_then(|baseline| baseline.number(machine));
        let line = RequestLine { stops, ..order.line() };
        let outcome = attempt(machine, order, &line, interrupted, &mut waits);
        let limit = match &outcome {
            Err(OperatorError::NoDaemon(_)) if order.is_patient => DAEMON_START_LIMIT.min(order.timeout),
            // Repeats only while this command's own request is not too old.
            Err(OperatorError::Stale(..)) => Duration::from_nanos(MAX_REQUEST_AGE_NS),
            _ => return outcome,
        };
        if began.elapsed() > limit || interrupted() {
            return outcome;
        }
        sleep(RETRY_INTERVAL);
    }
}

fn attempt(
    machine: &str,
    order: &Order,
    line: &RequestLine,
    interrupted: &dyn Fn() -> bool,
    waits: &mut impl FnMut(&str),
) -> Result<String, OperatorError> {
    let ask = |connection: &mut Connection| {
        let until = Instant::now() + FIRST_LINE_LIMIT;
        converse(connection, line, until, order.timeout, interrupted, &mut *waits)
    };
    match query_first_trusted(machine, ask) {
        Ok(answer) => order.conclude(answer),
        Err(_) if interrupted() => Err(OperatorError::Interrupted),
        Err(OperatorError::NoAnswer(reason)) => Err(OperatorError::NotConfirmed(order.request, reason)),
        Err(error) => Err(error),
    }
}

/// Posts a request of a setpoint source for a cycle in simulated time. Returns once it is posted: the source may then publish its setpoint
/// of that cycle. The status of the cycle shows whether it was refused. When the connection closes before the cycle, it is withdrawn.
pub fn post_for_cycle(machine: &str, request: Request, cycle_ns: u64) -> Result<Connection, OperatorError> {
    let line = RequestLine {
        cycle_ns: Some(cycle_ns),
        within_s: CYCLE_LIMIT.as_secs_f64(),
        ..RequestLine::new(request.name())
    };
    let (connection, first) = first_answer(machine, |endpoint| {
        ask_at(endpoint, Endpoint::connect, |mut connection| {
            connection.send(&line)?;
            let first = connection.receive(Instant::now() + FIRST_LINE_LIMIT, || false)?;
            Ok(first.map(|first| (connection, first)))
        })
    })?;
    match first.result {
        RequestResult::Waiting => Ok(connection),
        _ => Order::new(request, CYCLE_LIMIT).conclude(first).map(|_| connection),
    }
}

/// The status of the daemon of a machine.
pub fn status(machine: &str) -> Result<AnswerLine, OperatorError> {
    first_answer(machine, request_status_from)
}

/// The same, for a source of setpoints that says something of its own input, and of its ride.
pub fn request_status_as_source(
    machine: &str,
    input: Option<String>,
    ride: Option<RidePhase>,
) -> Result<AnswerLine, OperatorError> {
    let line = RequestLine { input, ride, ..RequestLine::new("status") };
    first_answer(machine, |endpoint| status_at(endpoint, &line))
}

/// The status of the daemon that listens at an endpoint.
pub fn request_status_from(endpoint: &Endpoint) -> Result<AnswerLine, OperatorError> {
    status_at(endpoint, &RequestLine::new("status"))
}

fn status_at(endpoint: &Endpoint, line: &RequestLine) -> Result<AnswerLine, OperatorError> {
    ask_at(endpoint, Endpoint::connect_to_read, |mut connection| {
        let until = Instant::now() + FIRST_LINE_LIMIT;
        converse(&mut connection, line, until, FIRST_LINE_LIMIT, || false, |_| ())
    })
}

/// Sends a request about a ride, and waits for its answer. It is withdrawn if `interrupted`.
pub fn ride(
    machine: &str,
    order: RideOrder,
    yes: bool,
    within: Duration,
    interrupted: impl Fn() -> bool,
) -> Result<AnswerLine, OperatorError> {
    let (stops, within_s) = (stop_number(machine), within.as_secs_f64());
    let line = RequestLine { stops, yes, within_s, progress: true, ..RequestLine::new(order.name()) };
    let answer = query_first_trusted(machine, |connection| {
        converse(connection, &line, Instant::now() + FIRST_LINE_LIMIT, within, &interrupted, |_| ())
    });
    if interrupted() { Err(OperatorError::Interrupted) } else { answer }
}

/// Requests a reload of the machine file. Returns the changes as text.
pub fn reload(machine: &str, timeout: Duration) -> Result<String, OperatorError> {
    let line = RequestLine { progress: true, ..RequestLine::new("reload") };
    let answer = query_first_trusted(machine, |connection| {
        converse(connection, &line, Instant::now() + FIRST_LINE_LIMIT, timeout, || false, |_| ())
    });
    match answer {
        Ok(AnswerLine { result: RequestResult::Done, text, .. }) => Ok(text),
        Ok(AnswerLine { result: RequestResult::Unanswered, text, .. })
        | Err(OperatorError::NoAnswer(text)) => Err(OperatorError::ReloadNotConfirmed(text)),
        Ok(AnswerLine { text, .. }) => Err(OperatorError::ReloadRefused(text)),
        Err(error) => Err(error),
    }
}

/// Connects to the first daemon that counts.
pub fn connect(machine: &str) -> Result<Connection, OperatorError> {
    first_answer(machine, |endpoint| ask_at(endpoint, Endpoint::connect, |connection| Ok(Some(connection))))
}

/// The answer of the first daemon that counts. `ask` sends a request over a connection.
pub fn query_first_trusted(
    machine: &str,
    mut ask: impl FnMut(&mut Connection) -> io::Result<Option<AnswerLine>>,
) -> Result<AnswerLine, OperatorError> {
    first_answer(machine, |endpoint| {
        ask_at(endpoint, Endpoint::connect, |mut connection| ask(&mut connection))
    })
}

fn first_answer<T>(
    machine: &str,
    mut ask: impl FnMut(&Endpoint) -> Result<T, OperatorError>,
) -> Result<T, OperatorError> {
    let mut failure = OperatorError::NoDaemon(machine.into());
    for endpoint in endpoints(Some(machine)) {
        match ask(&endpoint) {
            Err(OperatorError::NoDaemon(_)) => {}
            // Another daemon may admit this user, or count.
            Err(error @ (OperatorError::Forbidden { .. } | OperatorError::NotTrusted { .. })) => {
                if matches!(failure, OperatorError::NoDaemon(_)) {
                    failure = error;
                }
            }
            answer => return answer,
        }
    }
    Err(failure)
}

fn ask_at<T>(
    endpoint: &Endpoint,
    connect: impl Fn(&Endpoint) -> io::Result<Attempt>,
    mut ask: impl FnMut(Connection) -> io::Result<Option<T>>,
) -> Result<T, OperatorError> {
    let mut reason = "it accepts nobody".to_owned();
    for _ in 0..ATTEMPTS {
        match connect(endpoint) {
            Ok(Attempt::Connected(connection)) if !endpoint.counts(&connection) => {
                return Err(
                    UntrustedDaemon::at(endpoint, &connection, "nothing was sent").error("the request")
                );
            }
            Ok(Attempt::Connected(connection)) => match ask(connection) {
                Ok(Some(answer)) => return Ok(answer),
                Ok(None) => {
                    reason = "is it stopped, or its log blocked?".into();
                    break;
                }
                // The daemon has closed it, as it does if too many clients connect.
                Err(error) => reason = error.to_string(),
            },
            Ok(Attempt::Full) => sleep(RETRY_INTERVAL),
            Ok(Attempt::Forbidden) => return Err(OperatorError::forbidden_at(endpoint)),
            Ok(Attempt::Absent) | Err(_) if endpoint.daemon.is_some() => break,
            Ok(Attempt::Absent) | Err(_) => return Err(OperatorError::NoDaemon(endpoint.machine.clone())),
        }
    }
    if !endpoint.is_trusted {
        return Err(OperatorError::NoDaemon(endpoint.machine.clone()));
    }
    let process =
        endpoint.daemon.as_ref().map_or("the daemon".into(), |it| format!("process {}", it.process_id));
    Err(OperatorError::NoAnswer(format!(
        "{process} does not answer at {}: {reason}",
        endpoint.socket.display()
    )))
}

/// When a person asked for control: the number of stops of the daemon that ran then; of none that ran, the number of a daemon that has
/// just begun. It is taken once, and no retry or wait takes a newer one. The daemon refuses what was asked for before the last stop, so
/// that nothing that still waits somewhere moves a platform that somebody has stopped.
#[derive(Clone, Copy, Debug)]
pub struct StopBaseline(Option<StopNumber>);

impl StopBaseline {
    /// Of a request that a person makes now.
    pub fn now(machine: &str) -> Self {
        Self(stop_number(machine))
    }

    /// Of a request that a person has made just before this answer to `status`.
    pub fn before(answer: &AnswerLine) -> Self {
        Self(stop_number_of(answer))
    }

    /// The number for the line of a request. `None` if no daemon runs, or an older one.
    fn number(&mut self, machine: &str) -> Option<StopNumber> {
        if self.0.is_none() {
            self.0 = stop_number(machine).map(|begun| StopNumber { count: 0, ..begun });
        }
        self.0
    }

    /// An error if a stop has come since.
    pub fn check(&mut self, machine: &str) -> Result<(), OperatorError> {
        let baseline = self.number(machine);
        match stop_number(machine) {
            Some(now) if baseline != Some(now) => {
                Err(OperatorError::NotCompleted(Request::Engage, STOPPED.into()))
            }
            _ => Ok(()),
        }
    }
}

fn stop_number(machine: &str) -> Option<StopNumber> {
    stop_number_of(&status(machine).ok()?)
}

fn stop_number_of(answer: &AnswerLine) -> Option<StopNumber> {
    answer.status.as_ref()?.stops
}
