//! Requests of clients, one per line: each is answered at once, or begun and answered later.

use core::sync::atomic::Ordering;

use tracing::{debug, info};

use super::connection::Connection;
use super::last_seconds::{LastSeconds, RECORD};
use super::order::{Order, PendingOrder};
use super::reload::RELOAD;
use super::{MAX_WITHIN_S, Server};
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::state::Request;
use crate::daemon::motion_requests::order::MotionOrder;
use crate::daemon::snapshot::Snapshot;
use crate::messages::clock::monotonic_ns;
use crate::operator::motion_fields::{GOTO, HOLD, JOG};
use crate::operator::protocol::{AnswerLine, RequestLine, RequestResult, is_stop};

impl Server<'_> {
    /// Responds to a line. False if the connection must be closed. `status` caches the answer to `status` for
    /// this round.
    pub(super) fn respond(
        &mut self,
        connection: &mut Connection,
        line: &RequestLine,
        snapshot: &Snapshot,
        status: &mut Option<AnswerLine>,
    ) -> bool {
        if line.request == "status" {
            self.status.mover = self.motions.client(&self.connection_ids);
            let answer = status.get_or_insert_with(|| self.status.answer(snapshot, self.woke_ns));
            debug!(user = %connection.peer.user(), process = connection.peer.process_id, "status");
            return connection.send(answer);
        }
        if line.request == RELOAD {
            info!(user = %connection.peer.user(), process = connection.peer.process_id, "request: {RELOAD}");
            return self.begin_reload(connection, line, snapshot);
        }
        if line.request == RECORD {
            info!(user = %connection.peer.user(), process = connection.peer.process_id, "request: {RECORD}");
            return match LastSeconds::order(&self.windows, connection.file.take(), line.last_s) {
                Ok(ordered) => connection.last_seconds.replace(ordered).is_none(),
                Err(reason) => connection.send(&AnswerLine::invalid(reason)),
            };
        }
        if MotionOrder::is_named(&line.request) {
            return self.begin_motion(connection, line, snapshot);
        }
        let Some(request) = line.controller_request() else {
            let names = Request::ALL.map(Request::name).join(", ");
            let text = format!(
                "unknown request {:?}; must be one of status, {RECORD}, {RELOAD}, {GOTO}, {HOLD}, {JOG}, {names}",
                line.request
            );
            return connection.send(&AnswerLine::invalid(text));
        };
        // Before the log, which may block.
        let answer = self.begin(connection, request, line, snapshot);
        let is_read = self.supersede_motion(connection, snapshot);
        let (user, process) = (connection.peer.user(), connection.peer.process_id);
        info!(%user, process, remote = line.remote.as_deref(), "request: {}", request.name());
        is_read
            && answer.is_none_or(|answer| {
                connection.peer.log_failure(&answer);
                connection.send(&answer)
            })
    }

    /// Posts a request, or returns the answer that refuses it.
    fn begin(
        &mut self,
        connection: &mut Connection,
        request: Request,
        line: &RequestLine,
        snapshot: &Snapshot,
    ) -> Option<AnswerLine> {
        let replaced = connection.pending.take();
        if is_stop(request) || request == Request::Park {
            self.motions.stop();
        }
        if request.can_begin_control()
            && let Some(answer) = self.refusal(request.name(), snapshot)
        {
            return Some(answer);
        }
        let within_ns = (line.within_s.clamp(0.0, MAX_WITHIN_S) * 1e9) as u64;
        let order = Order {
            request,
            waits: line.wait,
            is_patient: line.until_ready,
            deadline_ns: self.woke_ns + within_ns,
        };
        connection.wants_progress = line.progress;
        let pending = PendingOrder::post(order, snapshot, self.word, monotonic_ns());
        connection.pending = Some(pending);
        replaced.map(|replaced| replaced.superseded(snapshot))
    }
    /// Answer to a request that would begin control or motion, if the daemon ends, or if the request may be old.
    pub(super) fn refusal(&self, request: &str, snapshot: &Snapshot) -> Option<AnswerLine> {
        let state = snapshot.status.state().unwrap_or_default();
        let answer = |result, code: DiagnosticCode, text: &str| {
            Some(AnswerLine::named(result, request, state, Diagnostic::from(code), text.into()))
        };
        if self.is_ending.load(Ordering::Relaxed) {
            let code = DiagnosticCode::DaemonEnding;
            return answer(RequestResult::Refused, code, code.name());
        }
        let text = "the daemon was held and the request may be old; send it again";
        let is_stale = self.woke_ns < self.stale_until_ns;
        is_stale.then(|| answer(RequestResult::Stale, DiagnosticCode::None, text)).flatten()
    }
}
