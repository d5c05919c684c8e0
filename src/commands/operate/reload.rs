//! `hexad reload`: the daemon reads its machine file again.

use std::time::{Duration, Instant};

use super::endpoint::{Attempt, Connection, Endpoint, endpoints};
use super::{ANSWER_GRACE, OperatorError, PATIENT_FIRST_LINE_LIMIT, unreachable_daemon};
use crate::daemon::control_socket::protocol::{AnswerLine, RequestLine, RequestResult};

/// Requests it and waits for the outcome, in words.
pub fn reload(machine: &str, timeout: Duration) -> Result<String, OperatorError> {
    let mut forbidden = None;
    for endpoint in endpoints(machine) {
        match endpoint.connect() {
            Ok(Attempt::Connected(mut connection)) => {
                return conclude(&endpoint, converse(&mut connection, timeout));
            }
            Ok(Attempt::Forbidden) => forbidden = forbidden.or(Some(endpoint)),
            Ok(Attempt::Absent) | Err(_) => {}
        }
    }
    Err(unreachable_daemon(machine, forbidden.as_ref()))
}

/// Sends the request and reads until its answer; `None` if there is none.
fn converse(connection: &mut Connection, timeout: Duration) -> Option<AnswerLine> {
    connection.send(&RequestLine { progress: true, ..RequestLine::new("reload") }).ok()?;
    let mut until = Instant::now() + PATIENT_FIRST_LINE_LIMIT;
    loop {
        let answer = connection.receive(until, || false).ok()??;
        if answer.result != RequestResult::Accepted {
            return Some(answer);
        }
        until = Instant::now() + timeout + ANSWER_GRACE;
    }
}

fn conclude(endpoint: &Endpoint, answer: Option<AnswerLine>) -> Result<String, OperatorError> {
    let Some(answer) = answer else {
        let reason = format!("the daemon does not answer at {}", endpoint.socket.display());
        return Err(OperatorError::ReloadNotConfirmed(reason));
    };
    match answer.result {
        RequestResult::Done => Ok(answer.text),
        RequestResult::Unanswered => Err(OperatorError::ReloadNotConfirmed(answer.text)),
        _ => Err(OperatorError::ReloadRefused(answer.text)),
    }
}
