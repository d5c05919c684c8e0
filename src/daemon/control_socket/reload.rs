//! The request `reload`, which the reload thread carries out.

use super::Server;
use super::connection::Connection;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::daemon::reload::{ReloadError, Reloaded};
use crate::daemon::snapshot::Snapshot;
use crate::operator::protocol::{AnswerLine, RequestLine, RequestResult};

/// Name of the request. The controller does not process it.
pub const RELOAD: &str = "reload";

impl Server<'_> {
    /// Passes a reload to the reload thread, because reading and examining a file takes time. False if the
    /// client has left.
    pub(super) fn begin_reload(
        &mut self,
        connection: &mut Connection,
        line: &RequestLine,
        snapshot: &Snapshot,
    ) -> bool {
        self.reloads += 1;
        connection.reload = Some(self.reloads);
        // Does not fail, because the reload thread ends after this one.
        let _ = self.request_reload.send(connection.reload);
        let text = "the machine file is examined".into();
        !line.progress || connection.send(&answer_to_reload(RequestResult::Accepted, snapshot, text))
    }

    /// Answers the completed reloads.
    pub(super) fn answer_reloads(&mut self) {
        while let Ok(Reloaded { requester, loaded, outcome }) = self.reloaded.try_recv() {
            if let Some(loaded) = loaded {
                self.status.set_loaded(loaded);
            }
            let (result, text) = match outcome {
                Ok(text) => (RequestResult::Done, text),
                Err(error @ ReloadError::NoCycle) => (RequestResult::Unanswered, error.to_string()),
                Err(error) => (RequestResult::Refused, error.to_string()),
            };
            let answer = answer_to_reload(result, self.snapshots.read(), text);
            self.connections.retain_mut(|connection| {
                let is_answered = requester.is_some() && connection.reload == requester;
                !is_answered || {
                    connection.reload = None;
                    connection.send(&answer)
                }
            });
        }
    }
}

fn answer_to_reload(result: RequestResult, snapshot: &Snapshot, text: String) -> AnswerLine {
    let state = snapshot.status.state().unwrap_or_default();
    AnswerLine::named(result, RELOAD, state, Diagnostic::from(DiagnosticCode::None), text)
}
