//! The control thread: requests of operators over a Unix socket, one JSON object per line.
//!
//! The thread is neither the real-time thread nor the I/O thread. Its priority is below theirs, and above
//! ordinary processes and the threads that write files, so none of these delays a stop. It rests between its
//! rounds, so that malicious clients cannot take the whole processor. Stops are served first. Requests reach
//! the real-time thread through the request word; answers come from the snapshot that the I/O thread writes
//! in every cycle. The number of connections, the length of a line and the time for it are bounded, and the
//! thread never waits for a client.

use core::sync::atomic::{AtomicBool, Ordering};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender};
use std::thread::sleep;
use std::time::{Duration, SystemTime};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use tracing::warn;

use self::answer::OpenRequest;
use self::connection::{Connection, Received};
use self::location::ControlSocket;
use self::motion::Motions;
use self::order::Step;
use self::status::StatusSource;
use super::leg_confirmation::LegConfirmation;
use super::motion_requests::job::Job;
use super::pose_gate::PoseGate;
use super::recorder::WindowOrder;
use super::recorder::interruption::Interruption;
use super::reload::{Loaded, Reloaded, Requester};
use super::snapshot::Snapshot;
use hexad_client::messages::Rejection;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::operator::protocol::{AnswerLine, MAX_REQUEST_AGE_NS, RequestLine};
use hexad_client::realtime::request_word::RequestWord;
use hexad_client::realtime::triple_buffer::{Reader, Writer};
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::state::State;

mod answer;
mod connection;
pub mod location;
mod motion;
mod order;
mod pending_file;
mod reload;
mod respond;
mod ride;
pub mod status;

/// Largest number of connections. One more closes the first in the order of [`Connection::rank`].
const MAX_CONNECTIONS: usize = 64;

/// Longest wait for clients while nothing is pending \[ms\]; also the delay until the thread notices that the
/// daemon ends.
const IDLE_WAIT_MS: u8 = 50;
/// Longest wait while a request is pending \[ms\]: a period of a usual loop.
const PENDING_WAIT_MS: u8 = 1;

/// Lines answered per round, besides stops. Logging each takes most of the time.
const LINES_PER_ROUND: usize = 4;
/// Longest rest after a round \[ns\]. A stop may arrive during the rest, and the time in a blocking log is no
/// effort.
const MAX_REST_NS: u64 = 200_000;

/// Time after the process was held in which no request may begin control \[ns\], because it may be from
/// before. It suffices for the rounds that read the buffers of all connections.
const STALE_TIME_NS: u64 = 200_000_000;

/// Least time between two warnings about misbehaving clients \[ns\], so that they do not fill the log.
const WARNING_INTERVAL_NS: u64 = 1_000_000_000;

/// Answer to a request of a client that may only read.
const READING_ONLY: &str =
    "this socket is for reading: only status; operator.group names who may send requests";

/// Longest waiting time of a request \[s\].
const MAX_WITHIN_S: f64 = 86_400.0;

/// Links of the control thread to the other threads.
pub(super) struct ControlLinks<'a> {
    pub socket: ControlSocket,
    /// Snapshots, from the I/O thread.
    pub snapshots: Reader<Snapshot>,
    /// Request word, to the real-time thread.
    pub word: &'static RequestWord,
    /// Other poses in which the platform may be.
    pub gate: Arc<PoseGate>,
    /// Requests to the reload thread, and its results.
    pub request_reload: Sender<Requester>,
    pub reloaded: Receiver<Reloaded>,
    /// Orders of recordings, to the recorder.
    pub windows: SyncSender<WindowOrder>,
    /// Interruption of the recording, from the recorder.
    pub interruption: Arc<Interruption>,
    /// Confirmation of the legs; `None` if it is not kept.
    pub legs: Option<Arc<LegConfirmation>>,
    /// Motions and snapshots, to the motion thread.
    pub jobs: Sender<Job>,
    pub motion_snapshots: Writer<Snapshot>,
    /// Set when the daemon is to end.
    pub is_ending: &'a AtomicBool,
}

/// Serves clients until `stop`.
pub(super) fn run(loaded: Arc<Loaded>, links: ControlLinks<'_>, stop: &AtomicBool) {
    let mut server = Server::new(loaded, links);
    while !stop.load(Ordering::Relaxed) {
        server.rest();
        server.wait();
        server.accept();
        server.read();
        server.make_room();
        server.advance();
        server.advance_motion();
        server.advance_rides();
        server.answer_reloads();
        server.log_rejections();
        server.warn_of_legs();
    }
    server.advance();
}

struct Server<'a> {
    links: ControlLinks<'a>,
    /// Number of reload requests so far.
    reloads: u64,
    motions: Motions,
    /// Numbers of the connections in the last round, and of the last one accepted.
    connection_ids: Vec<u64>,
    accepted: u64,
    connections: Vec<Connection>,
    status: StatusSource,
    /// The present \[ns\].
    clock: fn() -> u64,
    /// End of the last wait \[ns\].
    woke_ns: u64,
    /// Until this instant, a request may be from before the process was held \[ns\].
    stale_until_ns: u64,
    /// Unix time of the beginning \[us\].
    began_us: u64,
    /// Instant of the last warning \[ns\], and the number of clients since then.
    warned_ns: u64,
    unserved: u64,
    /// The last logged rejections of setpoints and measurements.
    logged: [Option<Rejection>; 2],
    /// Whether the platform was under control in the last round.
    had_control: bool,
}

impl<'a> Server<'a> {
    fn new(loaded: Arc<Loaded>, links: ControlLinks<'a>) -> Self {
        Self {
            reloads: 0,
            motions: Motions::default(),
            connection_ids: Vec::with_capacity(2 * MAX_CONNECTIONS),
            accepted: 0,
            connections: Vec::with_capacity(2 * MAX_CONNECTIONS),
            status: StatusSource::new(loaded, links.interruption.clone(), links.legs.clone()),
            clock: monotonic_ns,
            woke_ns: monotonic_ns(),
            stale_until_ns: 0,
            began_us: SystemTime::UNIX_EPOCH.elapsed().map_or(0, |since| since.as_micros() as u64),
            warned_ns: 0,
            unserved: 0,
            logged: [None; 2],
            had_control: false,
            links,
        }
    }
}

impl Server<'_> {
    /// Rests for as long as the round has run, up to [`MAX_REST_NS`], so that others get the processor.
    fn rest(&self) {
        let worked_ns = monotonic_ns().saturating_sub(self.woke_ns);
        sleep(Duration::from_nanos(worked_ns.min(MAX_REST_NS)));
    }

    /// Waits for input, or for a short time.
    fn wait(&mut self) {
        let is_busy = |connection: &Connection| connection.is_waiting() || connection.has_line();
        let is_pending = self.motions.is_running() || self.connections.iter().any(is_busy);
        self.poll(PollTimeout::from(if is_pending { PENDING_WAIT_MS } else { IDLE_WAIT_MS }));
    }

    /// Waits for input, and closes connections whose client has left.
    fn poll(&mut self, timeout: PollTimeout) {
        let listeners = core::iter::once(&self.links.socket.listener).chain(&self.links.socket.reading);
        let mut events: Vec<_> = listeners.map(|it| PollFd::new(it.as_fd(), PollFlags::POLLIN)).collect();
        let listeners = events.len();
        events.extend(self.connections.iter().map(|connection| {
            let events = if connection.has_ended { PollFlags::empty() } else { PollFlags::POLLIN };
            PollFd::new(connection.stream.as_fd(), events)
        }));
        // Fails only if interrupted by a signal.
        let _ = poll(&mut events, timeout);
        let left = PollFlags::POLLHUP | PollFlags::POLLERR;
        let has_left = |event: &PollFd<'_>| {
            event.revents().is_some_and(|seen| seen.intersects(left) && !seen.contains(PollFlags::POLLIN))
        };
        let mut gone: Vec<bool> = events.iter().skip(listeners).map(has_left).collect();
        drop(events);
        let word = self.links.word;
        let mut gone = gone.drain(..);
        self.connections.retain(|connection| {
            let is_gone =
                gone.next().unwrap_or_default() && !connection.has_line() && connection.line.is_none();
            if let Some((_, pending)) = connection.pending.as_ref().filter(|_| is_gone) {
                pending.cancel(word);
            }
            !is_gone
        });
        let now_ns = (self.clock)();
        if now_ns.saturating_sub(self.woke_ns) > MAX_REQUEST_AGE_NS {
            self.stale_until_ns = now_ns + STALE_TIME_NS;
        }
        self.woke_ns = now_ns;
    }

    /// Accepts all waiting clients and reads from each at once, so that a stop does not wait for the lines of
    /// all others. If no more files can be opened, an existing connection is closed.
    fn accept(&mut self) {
        let snapshot = *self.links.snapshots.read();
        for _ in 0..MAX_CONNECTIONS {
            let (stream, may_request) = match self.links.socket.accept() {
                Ok(accepted) => accepted,
                Err(error) if matches!(error.raw_os_error(), Some(libc::EMFILE | libc::ENFILE)) => {
                    if let Some(count) = self.warning() {
                        warn!(
                            count,
                            "control socket: a client waits, and no file is free ({error}): raise LimitNOFILE"
                        );
                    }
                    if !self.close_least() {
                        // Sleeps to avoid a busy loop while other files use up the limit.
                        sleep(Duration::from_millis(PENDING_WAIT_MS.into()));
                        return;
                    }
                    continue;
                }
                Err(_) => return,
            };
            self.accepted += 1;
            let connection = Connection::new(stream, may_request, self.accepted, self.woke_ns);
            let Ok(mut connection) = connection else { continue };
            if self.receive(&mut connection, &snapshot) {
                self.connections.push(connection);
            }
        }
    }

    /// Closes connections beyond the largest number, after each was read once. However many connect, none is
    /// closed before its first line is read.
    fn make_room(&mut self) {
        while self.connections.len() > MAX_CONNECTIONS && self.close_least() {}
    }

    /// Closes the first connection in the order of [`Connection::rank`]. False if there is none.
    fn close_least(&mut self) -> bool {
        let ranks = self.connections.iter().enumerate().map(|(k, it)| (it.rank(), k));
        let Some((_, least)) = ranks.min() else { return false };
        let closed = self.connections.swap_remove(least);
        closed.pending.iter().for_each(|(_, pending)| pending.cancel(self.links.word));
        true
    }

    /// Reads at most one line of each connection. Stops are carried out at once, other requests a few per
    /// round.
    fn read(&mut self) {
        let snapshot = *self.links.snapshots.read();
        let mut connections = core::mem::take(&mut self.connections);
        connections.retain_mut(|connection| self.receive(connection, &snapshot));
        let (mut answered, mut last, mut status) = (0, 0, None);
        let mut place = 0;
        connections.retain_mut(|connection| {
            place += 1;
            let Some(line) = connection.line.take_if(|_| answered < LINES_PER_ROUND) else { return true };
            (answered, last) = (answered + 1, place);
            self.respond(connection, &line, &snapshot, &mut status)
        });
        // The next round begins with the connections after the last one answered.
        let last = last.min(connections.len());
        connections.rotate_left(last);
        self.connections = connections;
    }

    /// Receives a line. False if the connection must be closed.
    fn receive(&mut self, connection: &mut Connection, snapshot: &Snapshot) -> bool {
        if connection.line.is_some() {
            return true;
        }
        match connection.receive(self.woke_ns) {
            Received::Nothing => !connection.is_done(self.woke_ns),
            Received::Line(line) => match RequestLine::parse(&line) {
                Ok(line) if !connection.may_request && line.request != "status" => {
                    connection.answer(OpenRequest::of(&line), AnswerLine::invalid(READING_ONLY.into()))
                }
                Ok(line) if line.is_stop() => self.respond(connection, &line, snapshot, &mut None),
                Ok(line) => {
                    connection.line = Some(line);
                    true
                }
                Err((id, reason)) => connection.send(&AnswerLine { id, ..AnswerLine::invalid(reason) }),
            },
            Received::Garbage(reason) => {
                connection.send(&AnswerLine::invalid(reason.into()));
                self.warn_of(connection, reason);
                false
            }
        }
    }

    fn warn_of(&mut self, connection: &Connection, reason: &str) {
        if let Some(count) = self.warning() {
            let peer = &connection.peer;
            warn!(user = %peer.user(), process = peer.process_id, count, "control socket: closed: {reason}");
        }
    }

    /// Counts a client that misbehaves or is not served. Returns the number since the last warning, if a
    /// warning is due.
    fn warning(&mut self) -> Option<u64> {
        self.unserved += 1;
        let is_time = self.woke_ns.saturating_sub(self.warned_ns) > WARNING_INTERVAL_NS;
        is_time.then(|| {
            self.warned_ns = self.woke_ns;
            core::mem::take(&mut self.unserved)
        })
    }

    /// Logs each new reason for rejecting messages of a sender.
    fn log_rejections(&mut self) {
        let snapshot = self.links.snapshots.read();
        self.status.note_drivers(snapshot.measured_publishers);
        let found = [snapshot.setpoint_rejection, snapshot.measured_rejection];
        for ((topic, found), logged) in ["setpoint", "measured"].into_iter().zip(found).zip(&mut self.logged)
        {
            let Some(found) = found else { continue };
            if logged.is_none_or(|logged| !logged.is_same_kind(&found)) {
                warn!("{topic}: {found}");
                *logged = Some(found);
            }
        }
    }

    /// Warns when control begins with legs that are not confirmed.
    fn warn_of_legs(&mut self) {
        let has_control = self.links.snapshots.read().status.state().is_some_and(State::has_control);
        if !core::mem::replace(&mut self.had_control, has_control) && has_control {
            self.status.leg_warning().into_iter().for_each(|warning| warn!("{warning}"));
        }
    }

    /// Checks every pending request and answers those that have ended.
    fn advance(&mut self) {
        let (snapshot, now_ns, word) = (*self.links.snapshots.read(), (self.clock)(), self.links.word);
        let gate = self.links.gate.clone();
        self.connections.retain_mut(|connection| {
            let written = connection.pending_file.as_ref().and_then(|(_, file)| file.answer(&snapshot));
            if let Some(answer) = written
                && let Some((request, _)) = connection.pending_file.take()
                && !connection.answer(request, answer)
            {
                return false;
            }
            let Some((request, mut pending)) = connection.pending.take() else { return true };
            match pending.step(&snapshot, word, now_ns) {
                Step::Answer(mut line) => {
                    name_poses(&gate, &mut line);
                    connection.peer.log_failure(&line);
                    return connection.answer(request, line);
                }
                Step::Progress(line) => {
                    let progress = request.progress(line);
                    connection.pending = Some((request, pending));
                    return progress.is_none_or(|line| connection.send(&line));
                }
                Step::Wait => connection.pending = Some((request, pending)),
            }
            true
        });
    }
}

/// Adds the poses to a refusal because of them.
fn name_poses(gate: &PoseGate, answer: &mut AnswerLine) {
    if answer.diagnostic.code == DiagnosticCode::OtherPoses as u32 {
        answer.text += &format!(" ({})", gate.poses());
    }
}

#[cfg(test)]
mod tests;
