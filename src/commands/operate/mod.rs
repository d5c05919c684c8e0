//! `hexad engage | stop | park | clear | off | estop | reload`: an operator's request and its outcome.
//!
//! The request goes over the control socket, and the daemon's answer comes back. A command that ends with 0 has reached
//! its state. What stops the platform falls back on a signal where the socket does not answer ([`signal`]).

use core::fmt;
use std::fs::File;
use std::io;
use std::sync::mpsc::{Receiver, channel};
use std::thread::{sleep, spawn};
use std::time::{Duration, Instant};

use tracing::info;

use self::endpoint::{Attempt, Connection, Endpoint, endpoints};
use self::signal::Signalled;
use crate::config::identity::Identity;
use crate::control::state::Request;
pub use crate::daemon::control_socket::protocol::AnswerLine as Answer;
use crate::daemon::control_socket::protocol::{AnswerLine, RequestLine, RequestResult};
use crate::daemon::cycle::MAX_REQUEST_AGE_NS;
use crate::messages::PortError;
use crate::realtime::stop_request::Stop;

pub mod endpoint;
pub mod reload;
pub mod signal;

/// Longest wait for the first line of the daemon. A stop then goes by signal.
const FIRST_LINE_LIMIT: Duration = Duration::from_millis(500);
/// The same for requests that have no other way: longer than the daemon waits for its loop.
const PATIENT_FIRST_LINE_LIMIT: Duration = Duration::from_secs(3);

/// Longest wait for a recording of the last seconds: 160 MB on a slow disk.
const RECORD_LIMIT: Duration = Duration::from_secs(60);

/// Time beyond that of the request in which the daemon must have answered.
const ANSWER_GRACE: Duration = Duration::from_secs(2);

/// Longest wait of a patient request for a daemon that is about to start.
const DAEMON_START_LIMIT: Duration = Duration::from_secs(2);
/// Time between two attempts.
const RETRY_INTERVAL: Duration = Duration::from_millis(20);

/// Attempts of a request whose connection the daemon has closed, as it does when too many clients connect.
const ATTEMPTS: u32 = 5;

/// Why a request was not carried out.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error("no daemon runs for {0}: none listens in /run/hexad, and no user's is recorded")]
    NoDaemon(String),
    #[error("this user may not send requests for {machine} ({socket}): {allowed}")]
    Forbidden { machine: String, socket: String, allowed: String },
    #[error("{request} was refused: {reason}", request = .0.name(), reason = .1)]
    Refused(Request, String),
    #[error("{request} was not completed: {reason}", request = .0.name(), reason = .1)]
    NotCompleted(Request, String),
    #[error("{request} was not completed within {1} s: {reason}", request = .0.name(), reason = .2)]
    Timeout(Request, f64, String),
    #[error("{request} is not confirmed: {reason}", request = .0.name(), reason = .1)]
    NotConfirmed(Request, String),
    #[error("{request} was not carried out: {reason}", request = .0.name(), reason = .1)]
    Stale(Request, String),
    #[error("the daemon does not answer: {0}")]
    NoAnswer(String),
    #[error("reload was refused, nothing has changed:\n{0}")]
    ReloadRefused(String),
    #[error("reload is not confirmed: {0}")]
    ReloadNotConfirmed(String),
    #[error("the daemon has not written its last seconds: {0}")]
    NotRecorded(String),
    #[error("interrupted")]
    Interrupted,
}

/// A request that is to be carried out.
#[derive(Clone, Copy, Debug)]
pub struct Order {
    pub request: Request,
    /// Whether to wait for measurements and setpoint where they are missing, instead of being refused.
    pub is_patient: bool,
    pub timeout: Duration,
}

/// How a request was carried out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Name of the state that it led to.
    pub state: String,
    /// How it was confirmed, if not over the socket that it was sent to.
    pub confirmed: Option<String>,
}

/// Result of one connection.
enum Exchange {
    Answer(AnswerLine),
    /// The daemon has closed the connection.
    Closed,
    /// The daemon has sent nothing in time.
    Silent,
}

/// Sends the request and waits for its outcome. `waits` receives why it waits, each reason once. A patient request also
/// waits for a daemon that is about to start.
pub fn carry_out(
    machine: &Identity,
    order: &Order,
    stop: &Stop,
    mut waits: impl FnMut(&str),
) -> Result<Outcome, OperatorError> {
    let began = Instant::now();
    loop {
        let outcome = attempt(machine, order, stop, &mut waits);
        let limit = match &outcome {
            Err(OperatorError::NoDaemon(_)) if order.is_patient => DAEMON_START_LIMIT.min(order.timeout),
            // Only what this command has just sent itself is not old.
            Err(OperatorError::Stale(..)) => Duration::from_nanos(MAX_REQUEST_AGE_NS),
            _ => return outcome,
        };
        if began.elapsed() > limit || stop.is_requested() {
            return outcome;
        }
        sleep(RETRY_INTERVAL);
    }
}

/// Carries it out in a thread: setpoints must not wait. What it waits for is logged.
pub fn carry_out_in_background(
    machine: &Identity,
    order: Order,
    stop: &Stop,
) -> Receiver<Result<(), OperatorError>> {
    let (send, result) = channel();
    let (machine, stop) = (machine.clone(), stop.clone());
    spawn(move || {
        let name = order.request.name();
        let outcome = carry_out(&machine, &order, &stop, |reason| info!("{name} waits: {reason}"));
        // Nobody receives it when the command has ended.
        let _ = send.send(outcome.map(drop));
    });
    result
}

/// Sends the request to each daemon that may be there, until one answers.
fn attempt(
    machine: &Identity,
    order: &Order,
    stop: &Stop,
    waits: &mut impl FnMut(&str),
) -> Result<Outcome, OperatorError> {
    let places = endpoints(&machine.name);
    let mut forbidden = None;
    for endpoint in &places {
        let mut process_id = endpoint.daemon.as_ref().map(|daemon| daemon.process_id);
        let mut exchange = Exchange::Silent;
        for _ in 0..ATTEMPTS {
            let mut connection = match endpoint.connect().map_err(|error| failed(order, error))? {
                Attempt::Connected(connection) => connection,
                Attempt::Forbidden => {
                    forbidden = forbidden.or(Some(endpoint));
                    process_id = None;
                    break;
                }
                Attempt::Absent => break,
            };
            process_id = connection.process_id().or(process_id);
            exchange = converse(&mut connection, order, stop, waits)?;
            if !matches!(exchange, Exchange::Closed) {
                break;
            }
        }
        match (exchange, process_id) {
            (Exchange::Answer(answer), _) => return conclude(order, &answer),
            (_, Some(process_id)) => return without_socket(machine, order, endpoint, process_id),
            (_, None) => {}
        }
    }
    Err(unreachable_daemon(&machine.name, forbidden))
}

/// The status of the daemon of a machine.
pub fn status(machine: &str) -> Result<AnswerLine, OperatorError> {
    first_answer(machine, |endpoint| status_of(machine, endpoint))
}

/// The status of the daemon that listens there.
pub fn status_of(machine: &str, endpoint: &Endpoint) -> Result<AnswerLine, OperatorError> {
    let line = RequestLine::new("status");
    answer_of(machine, endpoint, PATIENT_FIRST_LINE_LIMIT, |connection| connection.send(&line))
}

/// Lets the daemon of a machine write its last seconds to a file; returns what it has written, in words.
pub fn record(machine: &str, last_s: f64, file: &File) -> Result<String, OperatorError> {
    let line = RequestLine { last_s: Some(last_s), ..RequestLine::new("record") };
    let answer = first_answer(machine, |endpoint| {
        answer_of(machine, endpoint, RECORD_LIMIT, |connection| connection.send_with(&line, file))
    })?;
    match answer.result {
        RequestResult::Done => Ok(answer.text),
        _ => Err(OperatorError::NotRecorded(answer.text)),
    }
}

/// The answer of the first daemon of a machine that gives one.
fn first_answer(
    machine: &str,
    answer: impl Fn(&Endpoint) -> Result<AnswerLine, OperatorError>,
) -> Result<AnswerLine, OperatorError> {
    let mut forbidden = None;
    for endpoint in endpoints(machine) {
        match answer(&endpoint) {
            Err(error @ OperatorError::Forbidden { .. }) => forbidden = forbidden.or(Some(error)),
            Err(OperatorError::NoDaemon(_)) => {}
            answer => return answer,
        }
    }
    Err(forbidden.unwrap_or_else(|| OperatorError::NoDaemon(machine.into())))
}

/// The answer of the daemon that listens there to one line.
fn answer_of(
    machine: &str,
    endpoint: &Endpoint,
    limit: Duration,
    send: impl FnOnce(&mut Connection) -> io::Result<()>,
) -> Result<AnswerLine, OperatorError> {
    match endpoint.connect() {
        Ok(Attempt::Connected(mut connection)) => {
            let until = Instant::now() + limit;
            let answer = send(&mut connection).and_then(|()| connection.receive(until, || false));
            let silent = || OperatorError::NoAnswer(format!("nothing within {limit:?}"));
            answer.map_err(|error| OperatorError::NoAnswer(error.to_string()))?.ok_or_else(silent)
        }
        Ok(Attempt::Forbidden) => Err(unreachable_daemon(machine, Some(endpoint))),
        Ok(Attempt::Absent) | Err(_) => Err(unreachable_daemon(machine, None)),
    }
}

/// Why no daemon was reached: it may not be, or there is none.
fn unreachable_daemon(machine: &str, forbidden: Option<&Endpoint>) -> OperatorError {
    forbidden.map_or_else(
        || OperatorError::NoDaemon(machine.into()),
        |endpoint| OperatorError::Forbidden {
            machine: machine.into(),
            socket: endpoint.socket.display().to_string(),
            allowed: endpoint.allowed(),
        },
    )
}

/// Sends the request and reads until its answer.
fn converse(
    connection: &mut Connection,
    order: &Order,
    stop: &Stop,
    waits: &mut impl FnMut(&str),
) -> Result<Exchange, OperatorError> {
    let line = RequestLine {
        wait: true,
        until_ready: order.is_patient,
        progress: true,
        within_s: order.timeout.as_secs_f64(),
        ..RequestLine::new(order.request.name())
    };
    if connection.send(&line).is_err() {
        return Ok(Exchange::Closed);
    }
    let first_limit = if is_stop(order.request) { FIRST_LINE_LIMIT } else { PATIENT_FIRST_LINE_LIMIT };
    let mut until = Instant::now() + first_limit;
    loop {
        match connection.receive(until, || stop.is_requested()) {
            Ok(Some(answer)) if answer.result == RequestResult::Waiting => waits(&answer.text),
            Ok(Some(answer)) if answer.result == RequestResult::Accepted => {}
            Ok(Some(answer)) => return Ok(Exchange::Answer(answer)),
            Ok(None) if stop.is_requested() => return Err(OperatorError::Interrupted),
            Ok(None) => return Ok(Exchange::Silent),
            Err(error) if error.kind() == io::ErrorKind::InvalidData => return Err(failed(order, error)),
            Err(_) => return Ok(Exchange::Closed),
        }
        until = Instant::now() + order.timeout + ANSWER_GRACE;
    }
}

/// The outcome that an answer means.
fn conclude(order: &Order, answer: &AnswerLine) -> Result<Outcome, OperatorError> {
    let (request, text) = (order.request, answer.text.clone());
    match answer.result {
        RequestResult::Done => Ok(Outcome { state: answer.state.clone(), confirmed: None }),
        RequestResult::Refused | RequestResult::Invalid => Err(OperatorError::Refused(request, text)),
        RequestResult::TimedOut => Err(OperatorError::Timeout(request, order.timeout.as_secs_f64(), text)),
        RequestResult::Stale => Err(OperatorError::Stale(request, text)),
        RequestResult::Unanswered => Err(OperatorError::NotConfirmed(request, text)),
        RequestResult::Failed
        | RequestResult::Superseded
        | RequestResult::Accepted
        | RequestResult::Waiting => Err(OperatorError::NotCompleted(request, text)),
    }
}

/// What stops the platform goes by signal; everything else has failed.
fn without_socket(
    machine: &Identity,
    order: &Order,
    endpoint: &Endpoint,
    process_id: u32,
) -> Result<Outcome, OperatorError> {
    let request = order.request;
    if !is_stop(request) {
        let reason = format!(
            "process {process_id} does not answer at {}: is it stopped, or its log blocked?",
            endpoint.socket.display()
        );
        return Err(OperatorError::NotConfirmed(request, reason));
    }
    match signal::send(machine, request, endpoint, process_id, order.timeout) {
        Signalled::Confirmed { state, way } => Ok(Outcome { state, confirmed: Some(way) }),
        Signalled::Unconfirmed(reason) => Err(OperatorError::NotConfirmed(request, reason)),
    }
}

fn is_stop(request: Request) -> bool {
    matches!(request, Request::Stop | Request::Off | Request::Estop)
}

fn failed(order: &Order, error: impl fmt::Display) -> OperatorError {
    OperatorError::NotCompleted(order.request, format!("control socket: {error}"))
}
