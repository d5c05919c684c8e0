//! The request `reload`, which the reload thread carries out.

use super::Server;
use super::answer::OpenRequest;
use super::connection::Connection;
use crate::control_socket::answer::answer_line;
use crate::reload::{ReloadError, Reloaded};
use crate::snapshot::Snapshot;
use hexad_client::operator::protocol::{AnswerLine, RequestLine, RequestResult};
use hexad_core::control::signals::diagnostic::Diagnostic;

/// Name of the request. The controller does not process it.
pub const RELOAD: &str = "reload";

impl Server<'_> {
    /// Passes a reload to the reload thread, because reading and examining a file takes time. False if the
    /// client has left.
    pub(super) fn begin_reload(
        &mut self,
        connection: &mut Connection,
        request: OpenRequest,
        line: &RequestLine,
        snapshot: &Snapshot,
    ) -> bool {
        if connection.reload.is_some() {
            let text = "a reload of this connection is in progress".into();
            return connection.answer(request, answer_to_reload(RequestResult::Refused, snapshot, text));
        }
        connection.peer.log_request(line);
        self.reloads += 1;
        // Does not fail, because the reload thread ends after this one.
        let _ = self.request_reload.send(Some(self.reloads));
        let text = "the machine file is examined".into();
        let progress = request.progress(answer_to_reload(RequestResult::Accepted, snapshot, text));
        connection.reload = Some((request, self.reloads));
        progress.is_none_or(|line| connection.send(&line))
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
                let answered = connection.reload.take_if(|(_, number)| requester == Some(*number));
                answered.is_none_or(|(request, _)| connection.answer(request, answer.clone()))
            });
        }
    }
}

fn answer_to_reload(result: RequestResult, snapshot: &Snapshot, text: String) -> AnswerLine {
    let state = snapshot.status.state().unwrap_or_default();
    answer_line(result, RELOAD, state, &Diagnostic::default(), text)
}
