//! Client of the requests `goto`, `hold` and `jog`: one connection to the daemon, to which the motion belongs.

use std::io;
use std::time::{Duration, Instant};

use super::failure::{CommandError, INTERRUPTED};
use hexad_client::operator::OperatorError;
use hexad_client::operator::connection::Connection;
use hexad_client::operator::motion_fields::HOLD;
use hexad_client::operator::protocol::{AnswerLine, RequestLine, RequestResult};
use hexad_client::operator::requests::connect;
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::state::State;
use hexad_machine::text::files::remark;

/// Longest wait for an answer that the daemon gives at once, and for a platform that comes to rest.
const ANSWER_LIMIT: Duration = Duration::from_secs(5);
const REST_LIMIT: Duration = Duration::from_secs(60);
/// Number of the request that ends a motion.
const REST: u64 = 1;

/// Reason why a motion was not carried out.
#[derive(Debug, thiserror::Error)]
pub enum MotionError {
    #[error(transparent)]
    Operator(#[from] OperatorError),
    #[error("{0}")]
    Invalid(String),
    #[error("{0}")]
    Failed(String),
    #[error("{0}")]
    TimedOut(String),
    #[error("the daemon does not answer: {0}")]
    NoAnswer(String),
    #[error("interrupted; the platform stands under control; hexad stop or park ends it")]
    Interrupted,
    #[error("interrupted before control was taken; hexad status shows the state")]
    InterruptedEarly,
}

impl CommandError for MotionError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Operator(error) => error.exit_code(),
            Self::Invalid(_) => 2,
            Self::Interrupted | Self::InterruptedEarly => INTERRUPTED,
            _ => 1,
        }
    }
}

impl From<io::Error> for MotionError {
    fn from(error: io::Error) -> Self {
        Self::NoAnswer(error.to_string())
    }
}

/// Connection to a daemon. When it ends, its motion comes to rest.
pub struct MotionClient<'a> {
    connection: Connection,
    stop: &'a Stop,
}

impl<'a> MotionClient<'a> {
    /// Connects to the daemon of a machine.
    pub fn connect(machine: &str, stop: &'a Stop) -> Result<Self, MotionError> {
        Ok(Self { connection: connect(machine)?, stop })
    }

    /// Sends a request and waits for its end. A signal brings the platform to rest. `begun` receives the sentence about the motion.
    pub fn carry_out(
        &mut self,
        line: RequestLine,
        mut begun: impl FnMut(&str) -> io::Result<()>,
    ) -> Result<AnswerLine, MotionError> {
        self.connection.send(&RequestLine { wait: true, progress: true, ..line })?;
        loop {
            let until = Instant::now() + ANSWER_LIMIT;
            match self.connection.receive(until, || self.stop.is_requested())? {
                Some(answer) if answer.result == RequestResult::Waiting => {
                    remark(format_args!("waiting: {}", answer.text));
                }
                Some(answer) if answer.result == RequestResult::Accepted => begun(&answer.text)?,
                Some(answer) => return completed(answer),
                None if self.stop.is_requested() => return Err(self.rest()?),
                None => {}
            }
        }
    }

    /// Brings the platform to rest where it is.
    fn rest(&mut self) -> Result<MotionError, MotionError> {
        self.connection.send(&RequestLine { wait: true, id: Some(REST), ..RequestLine::new(HOLD) })?;
        let until = Instant::now() + REST_LIMIT;
        let repeated = || self.stop.is_repeated();
        while let Some(answer) = self.connection.receive(until, repeated)? {
            match answer.result {
                _ if answer.id != Some(REST) => {}
                RequestResult::Refused => return Ok(MotionError::InterruptedEarly),
                RequestResult::Done => return Ok(MotionError::Interrupted),
                _ => return completed(answer).map(|_| MotionError::Interrupted),
            }
        }
        Ok(MotionError::Interrupted)
    }

    /// The answer to a request that is answered at once.
    pub fn ask(&mut self, line: &RequestLine) -> Result<AnswerLine, MotionError> {
        self.connection.send(line)?;
        let answer = self.connection.receive(Instant::now() + ANSWER_LIMIT, || false)?;
        answer.ok_or_else(|| MotionError::NoAnswer("is it stopped, or its log blocked?".into()))
    }

    /// The status of the daemon. An error if the platform is not under control.
    pub fn status_under_control(&mut self) -> Result<AnswerLine, MotionError> {
        let answer = self.ask(&RequestLine::new("status"))?;
        let follows = State::by_name(&answer.state).is_some_and(State::follows);
        let AnswerLine { state, text, .. } = &answer;
        let ended = || MotionError::Failed(format!("control has ended: the daemon is in {state}: {text}"));
        if follows { Ok(answer) } else { Err(ended()) }
    }
}

/// The answer, or the reason why the request has failed.
fn completed(answer: AnswerLine) -> Result<AnswerLine, MotionError> {
    match answer.result {
        RequestResult::Done => Ok(answer),
        RequestResult::Invalid => Err(MotionError::Invalid(answer.text)),
        RequestResult::TimedOut => Err(MotionError::TimedOut(answer.text)),
        _ => Err(MotionError::Failed(answer.text)),
    }
}
