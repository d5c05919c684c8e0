//! Requests `goto`, `hold` and `jog`, which the motion thread carries out.
//!
//! One motion runs at a time. It belongs to its connection: requests of other connections are refused meanwhile, and a
//! later one of the same connection takes over.

use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

use tracing::debug;

use super::answer::OpenRequest;
use super::connection::Connection;
use super::order::{Order, PendingOrder, REPLACED, Step, overruling_count};
use super::{MAX_WITHIN_S, Server, name_poses};
use crate::motion_requests::job::{End, Job, Jog, MotionEvent, MotionInput};
use crate::motion_requests::order::{MotionKind, MotionOrder};
use crate::snapshot::Snapshot;
use hexad_client::operator::motion_fields::GOTO;
use hexad_client::operator::protocol::{AnswerLine, RequestLine, RequestResult, STOPPED};
use hexad_client::realtime::request_word::RequestWord;
use hexad_core::control::signals::state::Request;

/// The motion that the motion thread carries out.
#[derive(Default)]
pub struct Motions {
    pub(super) running: Option<Running>,
    /// The motion that takes over when the running one has ended.
    pub(super) next: Option<(Job, Running)>,
}

/// Motion in progress.
pub(super) struct Running {
    request: String,
    unanswered: Option<OpenRequest>,
    /// [`overruling_count`] when it was asked for: after a stop it takes no control.
    stops_before: u32,
    /// Whether it is planned.
    has_begun: bool,
    /// Number of its connection, and the process of the client.
    connection: u64,
    process_id: i32,
    ends_with_connection: bool,
    /// Whether its answer comes when it is completed.
    waits: bool,
    /// Longest wait for control \[ns\].
    within_ns: u64,
    engagement: Option<PendingOrder>,
    is_jog: bool,
    /// The bound that stops a jog; empty without one.
    blocked: String,
    inputs: Sender<MotionInput>,
    events: Receiver<MotionEvent>,
}

impl Motions {
    /// Whether a motion is in progress.
    pub fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// Process of the client of the motion, if it is connected.
    pub fn client(&self, connections: &[u64]) -> Option<u32> {
        let running = self.running.as_ref().filter(|running| connections.contains(&running.connection))?;
        u32::try_from(running.process_id).ok().filter(|process_id| *process_id > 0)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Its client has left.
        self.unanswered.take().into_iter().for_each(OpenRequest::forget);
    }
}

impl Running {
    /// Whether the connection to which it belongs has ended.
    fn has_left(&self, connections: &[u64]) -> bool {
        self.ends_with_connection && !connections.contains(&self.connection)
    }

    /// Whether it is to begin, and a stop came after it was asked for.
    fn is_stopped(&self, word: &RequestWord) -> bool {
        !self.has_begun && self.stops_before != overruling_count(word, Request::Engage)
    }

    fn end(&self, end: End) {
        // It may have ended just now.
        let _ = self.inputs.send(MotionInput::End(end));
    }
}

impl Server<'_> {
    /// Begins a motion, or passes on another request of a jog. False if the connection must be closed.
    pub(super) fn begin_motion(
        &mut self,
        connection: &mut Connection,
        request: OpenRequest,
        line: &RequestLine,
        snapshot: &Snapshot,
    ) -> bool {
        let stops_before = overruling_count(self.links.word, Request::Engage);
        let order = match MotionOrder::of_line(line, &self.status.loaded().config) {
            Ok(order) => order,
            Err(reason) => return connection.answer(request, AnswerLine::invalid(reason)),
        };
        if let Some(answer) = self.refusal(line, snapshot) {
            return connection.answer(request, answer);
        }
        let named =
            |result, text: String| snapshot.answer(result, &line.request, snapshot.diagnostic(), text);
        let (peer, time_ns) = (connection.peer.clone(), self.woke_ns);
        if let Some(text) = self.motion_of_other(connection.id) {
            return connection.answer(request, named(RequestResult::Refused, text));
        }
        if let Some(running) = &self.motions.running {
            let is_own = running.connection == connection.id;
            if let (MotionKind::Jog(rates), true, None) =
                (&order.kind, is_own && running.is_jog, &self.motions.next)
            {
                let jog = Jog { rates: *rates, coordinates: order.coordinates.clone(), time_ns };
                if running.inputs.send(MotionInput::Jog(Box::new(jog))).is_ok() {
                    debug!(user = %peer.user(), process = peer.process_id, "jog");
                    return connection
                        .answer(request, named(RequestResult::Accepted, running.blocked.clone()));
                }
            }
            running.end(End::TakeOver);
        }
        let is_read = self.supersede_motion(connection, snapshot);
        let replaced = connection.pending.take().inspect(|(_, replaced)| replaced.cancel(self.links.word));
        let is_read =
            is_read & replaced.is_none_or(|(it, order)| connection.answer(it, order.superseded(snapshot)));
        let ((inputs, received), (sent, events)) = (channel(), channel());
        let running = Running {
            request: line.request.clone(),
            unanswered: Some(request),
            stops_before,
            has_begun: false,
            connection: connection.id,
            process_id: peer.process_id,
            ends_with_connection: line.wait || line.request != GOTO,
            waits: line.wait && !matches!(order.kind, MotionKind::Jog(_)),
            within_ns: (line.within_s.clamp(0.0, MAX_WITHIN_S) * 1e9) as u64,
            engagement: None,
            is_jog: matches!(order.kind, MotionKind::Jog(_)),
            blocked: String::new(),
            inputs,
            events,
        };
        connection.waits_for_motion = true;
        let job = Job::new(self.status.loaded().clone(), order, time_ns, received, sent);
        self.motions.next = Some((job, running));
        peer.log_request(line);
        is_read
    }

    /// Why a connection may begin no motion: another one has begun one.
    fn motion_of_other(&self, id: u64) -> Option<String> {
        let Motions { running, next, .. } = &self.motions;
        let mut motions = running.iter().chain(next.iter().map(|(_, next)| next));
        let other = motions.find(|it| it.connection != id && self.connection_ids.contains(&it.connection))?;
        Some(format!(
            "a {} of process {} is in progress; end it first (hexad stop, or Ctrl-C there)",
            other.request, other.process_id
        ))
    }

    /// Passes on the newest snapshot, and answers what the motion thread has reported.
    pub(super) fn advance_motion(&mut self) {
        let snapshot = *self.links.snapshots.read();
        self.links.motion_snapshots.write(snapshot);
        self.connection_ids.clear();
        self.connection_ids.extend(self.connections.iter().map(|connection| connection.id));
        self.motions.next.take_if(|(_, next)| next.has_left(&self.connection_ids));
        let word = self.links.word;
        if let Some((_, mut next)) = self.motions.next.take_if(|(_, next)| next.is_stopped(word)) {
            self.answer_motion(&mut next, RequestResult::Superseded, STOPPED.into(), &snapshot);
        }
        let Some(mut running) = self.motions.running.take() else {
            return self.begin_next();
        };
        if running.has_left(&self.connection_ids) {
            running.end(End::Rest);
        }
        if running.is_stopped(word) {
            running.end(End::AtOnce);
            self.answer_motion(&mut running, RequestResult::Superseded, STOPPED.into(), &snapshot);
        }
        let has_ended = self.receive_events(&mut running, &snapshot);
        if !has_ended {
            self.motions.running = Some(running);
            return;
        }
        if let Some(engagement) = &running.engagement {
            engagement.cancel(self.links.word);
        }
        self.answer_motion(&mut running, RequestResult::Superseded, REPLACED.into(), &snapshot);
        self.begin_next();
    }

    fn begin_next(&mut self) {
        if let Some((job, running)) = self.motions.next.take() {
            self.motions.running = Some(running);
            // It does not fail, because the motion thread ends after this one.
            let _ = self.links.jobs.send(job);
        }
    }

    /// Receives the events of a motion. True if it has ended.
    fn receive_events(&mut self, running: &mut Running, snapshot: &Snapshot) -> bool {
        loop {
            match running.events.try_recv() {
                Ok(MotionEvent::Accepted(text)) => {
                    running.has_begun = true;
                    if running.waits {
                        self.report_progress(running, RequestResult::Accepted, text, snapshot);
                    } else {
                        self.answer_motion(running, RequestResult::Accepted, text, snapshot);
                    }
                }
                Ok(MotionEvent::WantsControl) => {
                    let deadline_ns = self.woke_ns + running.within_ns;
                    let (request, stops_before) = (Request::Engage, running.stops_before);
                    let (waits, is_patient, cycle_ns) = (true, true, None);
                    let order = Order { request, stops_before, waits, is_patient, deadline_ns, cycle_ns };
                    let pending = PendingOrder::post(order, snapshot, self.links.word, (self.clock)());
                    running.engagement = Some(pending);
                }
                Ok(MotionEvent::Blocked(bound)) => running.blocked = bound.unwrap_or_default(),
                Ok(MotionEvent::Done(text)) => {
                    self.answer_motion(running, RequestResult::Done, text, snapshot);
                }
                Ok(MotionEvent::Failed(result, text)) => {
                    // Else it might take control that a stop has just ended.
                    if let Some((_, mut next)) = self.motions.next.take() {
                        self.answer_motion(&mut next, result, text.clone(), snapshot);
                    }
                    self.answer_motion(running, result, text, snapshot);
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return true,
            }
        }
        self.advance_engagement(running, snapshot);
        false
    }

    /// Checks the wait for control of a motion.
    fn advance_engagement(&mut self, running: &mut Running, snapshot: &Snapshot) {
        let Some(engagement) = &mut running.engagement else { return };
        let step = engagement.step(snapshot, self.links.word, (self.clock)());
        let (result, text) = match step {
            Step::Wait => return,
            Step::Progress(line) => return self.report_progress(running, line.result, line.text, snapshot),
            Step::Answer(line) if line.result == RequestResult::Done => {
                running.engagement = None;
                return;
            }
            Step::Answer(mut line) => {
                name_poses(&self.links.gate, &mut line);
                (line.result, format!("engage: {}", line.text))
            }
        };
        engagement.cancel(self.links.word);
        running.engagement = None;
        running.end(End::AtOnce);
        self.answer_motion(running, result, text, snapshot);
    }

    fn report_progress(
        &mut self,
        running: &Running,
        result: RequestResult,
        text: String,
        snapshot: &Snapshot,
    ) {
        let connection = self.connections.iter_mut().find(|it| it.id == running.connection);
        let line = snapshot.answer(result, &running.request, snapshot.diagnostic(), text);
        let progress = running.unanswered.as_ref().and_then(|request| request.progress(line));
        if let Some((connection, line)) = connection.zip(progress) {
            // A client that has left is noticed in the next round.
            connection.send(&line);
        }
    }

    /// Answers the request of a motion, unless it was answered.
    fn answer_motion(
        &mut self,
        running: &mut Running,
        result: RequestResult,
        text: String,
        snapshot: &Snapshot,
    ) {
        let Some(request) = running.unanswered.take() else { return };
        match self.connections.iter_mut().find(|it| it.id == running.connection) {
            Some(connection) => {
                let answer = snapshot.answer(result, &running.request, snapshot.diagnostic(), text);
                connection.waits_for_motion = false;
                connection.peer.log_failure(&answer);
                connection.answer(request, answer);
            }
            None => request.forget(),
        }
    }

    /// Answers the motions of a connection that wait, because its later request replaces them; those that are not under control yet
    /// end. False if it does not read.
    pub(super) fn supersede_motion(&mut self, connection: &mut Connection, snapshot: &Snapshot) -> bool {
        connection.waits_for_motion = false;
        let id = connection.id;
        let mut is_read = true;
        let mut supersede = |it: &mut Running| {
            if let Some(request) = it.unanswered.take() {
                let superseded =
                    snapshot.answer(RequestResult::Superseded, &it.request, snapshot.diagnostic(), REPLACED);
                is_read &= connection.answer(request, superseded);
            }
        };
        if let Some((_, mut next)) = self.motions.next.take_if(|(_, next)| next.connection == id) {
            supersede(&mut next);
        }
        if let Some(running) = self.motions.running.as_mut().filter(|running| running.connection == id) {
            supersede(running);
            let engagement = running.engagement.take();
            if engagement.is_some() || !running.has_begun {
                running.end(End::AtOnce);
            }
            engagement.into_iter().for_each(|engagement| engagement.cancel(self.links.word));
        }
        is_read
    }
}
