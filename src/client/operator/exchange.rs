//! One request over one connection.

use std::io;
use std::time::{Duration, Instant};

use super::connection::Connection;
use super::protocol::{AnswerLine, RequestLine, RequestResult};
use super::{OperatorError, Order};

/// Time after the timeout of the request within which the daemon must answer.
const ANSWER_GRACE: Duration = Duration::from_secs(2);

impl Order<'_> {
    /// Request line of the order.
    pub(super) fn line(&self) -> RequestLine {
        RequestLine {
            wait: true,
            until_ready: self.is_patient,
            progress: true,
            within_s: self.timeout.as_secs_f64(),
            remote: self.remote.map(Into::into),
            pose: self.pose,
            ..RequestLine::new(self.request.name())
        }
    }

    /// Evaluates an answer: the name of the resulting state, or the reason why the request failed.
    pub(super) fn conclude(&self, answer: AnswerLine) -> Result<String, OperatorError> {
        let (request, text) = (self.request, answer.text);
        match answer.result {
            RequestResult::Done => Ok(answer.state),
            RequestResult::Refused | RequestResult::Invalid => Err(OperatorError::Refused(request, text)),
            RequestResult::TimedOut => {
                Err(OperatorError::TimedOut(request, self.timeout.as_secs_f64(), text))
            }
            RequestResult::Stale => Err(OperatorError::Stale(request, text)),
            RequestResult::Unanswered => Err(OperatorError::NotConfirmed(request, text)),
            RequestResult::Failed
            | RequestResult::Superseded
            | RequestResult::Accepted
            | RequestResult::Waiting => Err(OperatorError::NotCompleted(request, text)),
        }
    }
}

/// Sends a line and reads until its answer; `None` if none arrived. The first line must arrive before
/// `until`, the answer within `timeout` and a short grace. `waits` receives the reasons why the daemon waits.
pub(super) fn converse(
    connection: &mut Connection,
    line: &RequestLine,
    first_until: Instant,
    timeout: Duration,
    interrupted: impl Fn() -> bool,
    mut waits: impl FnMut(&str),
) -> io::Result<Option<AnswerLine>> {
    connection.send(line)?;
    let mut until = first_until;
    loop {
        match connection.receive(until, &interrupted)? {
            Some(answer) if answer.result == RequestResult::Waiting => waits(&answer.text),
            Some(answer) if answer.result == RequestResult::Accepted => {}
            answer => return Ok(answer),
        }
        until = Instant::now() + timeout + ANSWER_GRACE;
    }
}
