//! Status of the daemon, received by a separate thread, so that publishing setpoints and reading keys do not
//! wait for it.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{sleep, spawn};
use std::time::{Duration, Instant};

use crate::config::Config;
use crate::operator::OperatorError;
use crate::operator::protocol::AnswerLine as Answer;
use crate::operator::requests::status;

/// Interval between two requests, short enough for a reader.
const INTERVAL: Duration = Duration::from_millis(50);

/// The two newest statuses.
#[derive(Clone, Debug)]
pub struct Watched {
    pub newest: (Instant, Answer),
    pub before: Option<(Instant, Answer)>,
    /// Error of the last request.
    pub error: Option<String>,
}

/// Receiver of the daemon's status. Its thread ends after it is dropped.
pub struct StatusWatch(Arc<Mutex<Watched>>);

impl StatusWatch {
    /// Starts the thread with a first status.
    pub fn start(config: &Config, first: Answer) -> Self {
        let watched = Watched { newest: (Instant::now(), first), before: None, error: None };
        let shared = Arc::new(Mutex::new(watched));
        let (weak, name) = (Arc::downgrade(&shared), config.name.clone());
        spawn(move || {
            while let Some(shared) = weak.upgrade() {
                let requested = Instant::now();
                let answer = status(&name);
                shared.lock().unwrap_or_else(PoisonError::into_inner).receive(requested, answer);
                drop(shared);
                sleep(INTERVAL);
            }
        });
        Self(shared)
    }

    pub fn newest(&self) -> Watched {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Watched {
    fn receive(&mut self, requested: Instant, answer: Result<Answer, OperatorError>) {
        match answer {
            Ok(answer) => {
                let before = core::mem::replace(&mut self.newest, (requested, answer));
                (self.before, self.error) = (Some(before), None);
            }
            Err(error) => self.error = Some(error.to_string()),
        }
    }
}
