//! The request `reload`, which the reload thread carries out.

use super::Server;
use super::answer::OpenRequest;
use super::connection::Connection;
use crate::reload::{ReloadError, Reloaded};
use crate::snapshot::Snapshot;
use hexad_client::operator::protocol::{RequestLine, RequestResult};
use hexad_core::control::signals::diagnostic::DiagnosticCode;

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
            let text = "a reload of this connection is in progress";
            return connection.answer(
                request,
                snapshot.answer(RequestResult::Refused, RELOAD, DiagnosticCode::None, text),
            );
        }
        connection.peer.log_request(line);
        self.reloads += 1;
        // Does not fail, because the reload thread ends after this one.
        let _ = self.links.request_reload.send(Some(self.reloads));
        let text = "the machine file is examined";
        let progress =
            request.progress(snapshot.answer(RequestResult::Accepted, RELOAD, DiagnosticCode::None, text));
        connection.reload = Some((request, self.reloads));
        progress.is_none_or(|line| connection.send(&line))
    }

    /// Answers the completed reloads.
    pub(super) fn answer_reloads(&mut self) {
        while let Ok(Reloaded { requester, loaded, outcome }) = self.links.reloaded.try_recv() {
            if let Some(loaded) = loaded {
                self.status.set_loaded(loaded);
            }
            let (result, text) = match outcome {
                Ok(text) => (RequestResult::Done, text),
                Err(error @ ReloadError::NoCycle) => (RequestResult::Unanswered, error.to_string()),
                Err(error) => (RequestResult::Refused, error.to_string()),
            };
            let answer = self.links.snapshots.read().answer(result, RELOAD, DiagnosticCode::None, text);
            self.connections.retain_mut(|connection| {
                let answered = connection.reload.take_if(|(_, number)| requester == Some(*number));
                answered.is_none_or(|(request, _)| connection.answer(request, answer.clone()))
            });
        }
    }
}
