//! Requests `goto`, `hold` and `jog`, which the motion thread carries out.
//!
//! One motion runs at a time. It belongs to its connection: requests of other connections are refused meanwhile, and a
//! later one of the same connection takes over.

use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

use tracing::{debug, info};

use super::connection::Connection;
use super::order::{Order, PendingOrder, Step};
use super::{MAX_WITHIN_S, Server};
use crate::control::signals::state::Request;
use crate::daemon::motion_requests::job::{End, Job, Jog, MotionEvent, MotionInput};
use crate::daemon::motion_requests::order::{Motion, MotionOrder};
use crate::daemon::snapshot::Snapshot;
use crate::messages::clock::monotonic_ns;
use crate::operator::motion_fields::GOTO;
use crate::operator::protocol::{AnswerLine, RequestLine, RequestResult};
use crate::realtime::triple_buffer::Writer;

const REPLACED: &str = "a later request has replaced it";

/// Links to the motion thread, and the motion that it carries out.
pub struct Motions {
    jobs: Sender<Job>,
    snapshots: Writer<Snapshot>,
    running: Option<Running>,
    /// The motion that takes over when the running one has ended.
    next: Option<(Job, Running)>,
    /// Whether a request has ended control since the last round.
    is_stopped: bool,
}

/// Motion in progress.
struct Running {
    request: String,
    /// Number of its connection, and the process of the client.
    connection: u64,
    process_id: i32,
    ends_with_connection: bool,
    /// Whether its answer comes when it is completed, and whether lines of progress come before.
    waits: bool,
    wants_progress: bool,
    is_answered: bool,
    /// Longest wait for control \[ns\].
    within_ns: u64,
    engagement: Option<PendingOrder>,
    /// Whether a request has ended control since it began; it then takes none.
    is_stopped: bool,
    is_jog: bool,
    /// The bound that stops a jog; empty without one.
    blocked: String,
    inputs: Sender<MotionInput>,
    events: Receiver<MotionEvent>,
}

impl Motions {
    /// No motion.
    pub fn new(jobs: Sender<Job>, snapshots: Writer<Snapshot>) -> Self {
        Self { jobs, snapshots, running: None, next: None, is_stopped: false }
    }

    /// Whether a motion is in progress.
    pub fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// Process of the client of the motion, if it is connected.
    pub fn client(&self, connections: &[u64]) -> Option<u32> {
        let running = self.running.as_ref().filter(|running| connections.contains(&running.connection))?;
        u32::try_from(running.process_id).ok().filter(|process_id| *process_id > 0)
    }

    /// Ends the wait for control of all motions, because a request has ended control.
    pub fn stop(&mut self) {
        self.is_stopped = true;
    }
}

impl Running {
    /// Whether the connection to which it belongs has ended.
    fn has_left(&self, connections: &[u64]) -> bool {
        self.ends_with_connection && !connections.contains(&self.connection)
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
        line: &RequestLine,
        snapshot: &Snapshot,
    ) -> bool {
        let order = match MotionOrder::of_line(line, &self.status.loaded().config) {
            Ok(order) => order,
            Err(reason) => return connection.send(&AnswerLine::invalid(reason)),
        };
        if let Some(answer) = self.refusal(&line.request, snapshot) {
            return connection.send(&answer);
        }
        let named = |result, text: String| answer(result, &line.request, snapshot, text);
        let (peer, time_ns) = (connection.peer.clone(), self.woke_ns);
        if let Some(running) = &self.motions.running {
            let is_own = running.connection == connection.id;
            if !is_own && self.connection_ids.contains(&running.connection) {
                let text = format!(
                    "a {} of process {} is in progress; end it first (hexad stop, or Ctrl-C there)",
                    running.request, running.process_id
                );
                return connection.send(&named(RequestResult::Refused, text));
            }
            if let (Motion::Jog(rates), true, None) =
                (&order.motion, is_own && running.is_jog, &self.motions.next)
            {
                let jog = Jog { rates: *rates, coordinates: order.coordinates.clone(), time_ns };
                if running.inputs.send(MotionInput::Jog(Box::new(jog))).is_ok() {
                    debug!(user = %peer.user(), process = peer.process_id, "jog");
                    return connection.send(&named(RequestResult::Accepted, running.blocked.clone()));
                }
            }
            running.end(End::TakeOver);
        }
        let is_read = self.supersede_motion(connection, snapshot);
        let replaced = connection.pending.take().map(|replaced| replaced.superseded(snapshot));
        let ((inputs, received), (sent, events)) = (channel(), channel());
        let running = Running {
            request: line.request.clone(),
            connection: connection.id,
            process_id: peer.process_id,
            ends_with_connection: line.wait || line.request != GOTO,
            waits: line.wait && !matches!(order.motion, Motion::Jog(_)),
            wants_progress: line.progress,
            is_answered: false,
            within_ns: (line.within_s.clamp(0.0, MAX_WITHIN_S) * 1e9) as u64,
            engagement: None,
            is_stopped: false,
            is_jog: matches!(order.motion, Motion::Jog(_)),
            blocked: String::new(),
            inputs,
            events,
        };
        connection.waits_for_motion = true;
        let job = Job::new(self.status.loaded().clone(), order, time_ns, received, sent);
        self.motions.next = Some((job, running));
        let remote = line.remote.as_deref();
        info!(user = %peer.user(), process = peer.process_id, remote, "request: {}", line.request);
        is_read && replaced.is_none_or(|replaced| connection.send(&replaced))
    }

    /// Passes on the newest snapshot, and answers what the motion thread has reported.
    pub(super) fn advance_motion(&mut self) {
        let snapshot = *self.snapshots.read();
        self.motions.snapshots.write(snapshot);
        self.connection_ids.clear();
        self.connection_ids.extend(self.connections.iter().map(|connection| connection.id));
        self.motions.next.take_if(|(_, next)| next.has_left(&self.connection_ids));
        let is_stopped = core::mem::take(&mut self.motions.is_stopped);
        if let Some((_, mut next)) = self.motions.next.take_if(|_| is_stopped) {
            self.answer_motion(&mut next, RequestResult::Superseded, REPLACED.into(), &snapshot);
        }
        let Some(mut running) = self.motions.running.take() else {
            return self.begin_next();
        };
        if running.has_left(&self.connection_ids) {
            running.end(End::Rest);
        }
        running.is_stopped |= is_stopped;
        let has_ended = self.receive_events(&mut running, &snapshot);
        if !has_ended {
            self.motions.running = Some(running);
            return;
        }
        if let Some(engagement) = &running.engagement {
            engagement.cancel(self.word);
        }
        self.answer_motion(&mut running, RequestResult::Superseded, REPLACED.into(), &snapshot);
        self.begin_next();
    }

    fn begin_next(&mut self) {
        if let Some((job, running)) = self.motions.next.take() {
            self.motions.running = Some(running);
            // It does not fail, because the motion thread ends after this one.
            let _ = self.motions.jobs.send(job);
        }
    }

    /// Receives the events of a motion. True if it has ended.
    fn receive_events(&mut self, running: &mut Running, snapshot: &Snapshot) -> bool {
        loop {
            match running.events.try_recv() {
                Ok(MotionEvent::Accepted(text)) if !running.waits => {
                    self.answer_motion(running, RequestResult::Accepted, text, snapshot);
                }
                Ok(MotionEvent::Accepted(text)) => {
                    self.report_progress(running, RequestResult::Accepted, text, snapshot);
                }
                Ok(MotionEvent::WantsControl) => {
                    let deadline_ns = self.woke_ns + running.within_ns;
                    let order =
                        Order { request: Request::Engage, waits: true, is_patient: true, deadline_ns };
                    let pending = PendingOrder::post(order, snapshot, self.word, monotonic_ns());
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
        let step = engagement.step(snapshot, self.word, monotonic_ns());
        let (result, text) = match step {
            _ if running.is_stopped => (RequestResult::Superseded, REPLACED.into()),
            Step::Wait => return,
            Step::Progress(line) => return self.report_progress(running, line.result, line.text, snapshot),
            Step::Answer(line) if line.result == RequestResult::Done => {
                running.engagement = None;
                return;
            }
            Step::Answer(line) => (line.result, format!("engage: {}", line.text)),
        };
        engagement.cancel(self.word);
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
        if let Some(connection) = connection.filter(|_| running.wants_progress && !running.is_answered) {
            // A client that has left is noticed in the next round.
            connection.send(&answer(result, &running.request, snapshot, text));
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
        if core::mem::replace(&mut running.is_answered, true) {
            return;
        }
        let connection = self.connections.iter_mut().find(|it| it.id == running.connection);
        if let Some(connection) = connection {
            let answer = answer(result, &running.request, snapshot, text);
            connection.waits_for_motion = false;
            connection.peer.log_failure(&answer);
            connection.send(&answer);
        }
    }

    /// Answers the motions of a connection that wait, because its later request replaces them. False if it does not read.
    pub(super) fn supersede_motion(&mut self, connection: &mut Connection, snapshot: &Snapshot) -> bool {
        connection.waits_for_motion = false;
        let Motions { running, next, .. } = &mut self.motions;
        let motions = running.iter_mut().chain(next.iter_mut().map(|(_, next)| next));
        let id = connection.id;
        let mut unanswered = motions.filter(|it| it.connection == id && !it.is_answered);
        unanswered.all(|it| {
            it.is_answered = true;
            connection.send(&answer(RequestResult::Superseded, &it.request, snapshot, REPLACED.into()))
        })
    }
}

fn answer(result: RequestResult, request: &str, snapshot: &Snapshot, text: String) -> AnswerLine {
    let state = snapshot.status.state().unwrap_or_default();
    let diagnostic = snapshot.status.diagnostic.diagnostic().unwrap_or_default();
    AnswerLine::named(result, request, state, diagnostic, text)
}
