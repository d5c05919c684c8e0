//! Connection of the control socket: reads lines and writes answers, without blocking.

use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::{getsockopt, sockopt::PeerCredentials};
use tracing::{info, warn};

use super::answer::OpenRequest;
use super::order::PendingOrder;
use super::pending_file::PendingFile;
use super::ride::PendingRide;
use hexad_client::operator::protocol::{AnswerLine, RequestLine, RequestResult, is_stop};
use hexad_client::operator::users::user_name;
use hexad_client::realtime::file_passing;

/// Longest line \[bytes\]: many times the longest request.
pub const MAX_LINE_BYTES: usize = 4096;

/// Longest time for the rest of a line that has begun \[ns\].
pub const LINE_LIMIT_NS: u64 = 2_000_000_000;

/// Longest time for the first line \[ns\]: panels connect before anybody touches them.
const FIRST_LINE_LIMIT_NS: u64 = 120_000_000_000;

/// User and process of the client, from the kernel.
#[derive(Clone, Debug)]
pub struct Peer {
    user_id: Option<u32>,
    pub process_id: i32,
}

impl Peer {
    fn of(stream: &UnixStream) -> Self {
        let found = getsockopt(&stream.as_fd(), PeerCredentials);
        let (user_id, process_id) = found.map_or((None, 0), |found| (Some(found.uid()), found.pid()));
        Self { user_id, process_id }
    }

    /// Name of the user. The system may need long to find it, so it is only for the log, after all other
    /// effort.
    pub fn user(&self) -> String {
        self.user_id.map_or_else(|| "unknown".into(), user_name)
    }

    /// Logs a request.
    pub fn log_request(&self, line: &RequestLine) {
        let (user, process, remote) = (self.user(), self.process_id, line.remote.as_deref());
        info!(%user, process, remote, pose = line.pose, "request: {}", line.request);
    }

    /// Logs a request that was not carried out, and the reason.
    pub fn log_failure(&self, answer: &AnswerLine) {
        let AnswerLine { result, request, state, diagnostic, text, .. } = answer;
        let is_success =
            matches!(result, RequestResult::Done | RequestResult::Accepted | RequestResult::Waiting);
        if is_success {
            return;
        }
        let (value, bound) = (diagnostic.value.unwrap_or_default(), diagnostic.bound.unwrap_or_default());
        warn!(
            user = %self.user(),
            process = self.process_id,
            state = %state,
            code = diagnostic.code,
            value,
            bound,
            "{request} {}: {text}",
            result.words()
        );
    }
}

/// Connection of a client.
#[derive(Debug)]
pub struct Connection {
    pub stream: UnixStream,
    pub peer: Peer,
    /// Whether the client may send requests, and not only read the status.
    pub may_request: bool,
    /// The request in progress.
    pub pending: Option<(OpenRequest, PendingOrder)>,
    /// The next line to be processed.
    pub line: Option<RequestLine>,
    /// Number of the reload in progress.
    pub reload: Option<(OpenRequest, u64)>,
    /// The file in progress.
    pub pending_file: Option<(OpenRequest, PendingFile)>,
    /// The order for a ride in progress.
    pub ride: Option<(OpenRequest, PendingRide)>,
    /// The last file that the client passed.
    pub file: Option<File>,
    /// Number of the connection.
    pub id: u64,
    /// Whether a motion is to be answered.
    pub waits_for_motion: bool,
    buffer: Vec<u8>,
    /// Instant at which a line must be complete \[ns\]; `None` after a complete one.
    line_until_ns: Option<u64>,
    /// Instant of the last line, at first of the connection \[ns\].
    used_ns: u64,
    has_requested: bool,
    /// Whether the client has ended its input.
    pub has_ended: bool,
}

/// Input of a connection.
#[derive(Debug, PartialEq, Eq)]
pub enum Received {
    Nothing,
    Line(String),
    /// The line is too long or not text. The connection must be closed.
    Garbage(&'static str),
}

impl Connection {
    /// A newly accepted connection.
    pub fn new(stream: UnixStream, may_request: bool, id: u64, now_ns: u64) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        let peer = Peer::of(&stream);
        Ok(Self {
            stream,
            peer,
            may_request,
            pending: None,
            line: None,
            reload: None,
            pending_file: None,
            ride: None,
            file: None,
            id,
            waits_for_motion: false,
            buffer: Vec::new(),
            line_until_ns: Some(now_ns + FIRST_LINE_LIMIT_NS),
            used_ns: now_ns,
            has_requested: false,
            has_ended: false,
        })
    }

    /// Whether the client waits for an answer.
    pub fn is_waiting(&self) -> bool {
        let Self { pending, line, reload, pending_file, ride, waits_for_motion, .. } = self;
        let waits = pending.is_some() || reload.is_some() || pending_file.is_some() || ride.is_some();
        waits || line.is_some() || *waits_for_motion
    }

    /// Whether the client has closed the connection, and not only its input.
    pub fn has_left(&self) -> bool {
        let mut event = [PollFd::new(self.stream.as_fd(), PollFlags::empty())];
        poll(&mut event, PollTimeout::ZERO).is_ok_and(|count| count > 0)
    }

    /// Reads at most the length of one line, and returns the next complete line.
    pub fn receive(&mut self, now_ns: u64) -> Received {
        let mut bytes = [0; MAX_LINE_BYTES];
        if !self.has_ended && !self.buffer.contains(&b'\n') {
            match file_passing::receive(&self.stream, &mut bytes) {
                Ok((0, _)) => self.has_ended = true,
                Ok((count, file)) => {
                    self.buffer.extend(bytes.iter().take(count));
                    self.file = file.or(self.file.take());
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Err(_) => self.has_ended = true,
            }
        }
        self.next_line(now_ns)
    }

    /// Whether a complete line has been read and not returned yet.
    pub fn has_line(&self) -> bool {
        self.buffer.contains(&b'\n')
    }

    fn next_line(&mut self, now_ns: u64) -> Received {
        let Some(end) = self.buffer.iter().position(|byte| *byte == b'\n') else {
            if self.buffer.len() >= MAX_LINE_BYTES {
                return Received::Garbage("the line is too long");
            }
            if !self.buffer.is_empty() {
                self.line_until_ns = Some(self.line_until_ns.unwrap_or(u64::MAX).min(now_ns + LINE_LIMIT_NS));
            }
            return Received::Nothing;
        };
        let line: Vec<u8> = self.buffer.drain(..=end).collect();
        (self.used_ns, self.has_requested) = (now_ns, true);
        self.line_until_ns = (!self.buffer.is_empty()).then_some(now_ns + LINE_LIMIT_NS);
        if line.len() > MAX_LINE_BYTES {
            return Received::Garbage("the line is too long");
        }
        String::from_utf8(line).map_or(Received::Garbage("the line is not UTF-8"), Received::Line)
    }

    /// Whether the connection is to be closed: the client has left and no answer is due, or a line is overdue, which the client
    /// receives as the last answer.
    pub fn is_done(&mut self, now_ns: u64) -> bool {
        if self.is_waiting() || self.has_line() {
            return false;
        }
        let is_slow = self.line_until_ns.is_some_and(|until_ns| now_ns > until_ns);
        if is_slow && !self.has_ended {
            self.send(&AnswerLine::invalid(format!(
                "closed: no line was complete in time: {} s for the first, {} s for the rest of one",
                FIRST_LINE_LIMIT_NS / 1_000_000_000,
                LINE_LIMIT_NS / 1_000_000_000
            )));
        }
        self.has_ended || is_slow
    }

    /// Answers a request. False if the client does not read its answers or has left.
    pub fn answer(&mut self, request: OpenRequest, answer: AnswerLine) -> bool {
        self.send(&request.answer(answer))
    }

    /// Sends a line. False if the client does not read its answers or has left.
    pub fn send(&mut self, answer: &AnswerLine) -> bool {
        let line = answer.to_line();
        matches!(self.stream.write(line.as_bytes()), Ok(count) if count == line.len())
    }

    /// Rank of connections for closing; the smallest is closed first. Order: clients without a request, then
    /// the longest unused, then those that wait for an answer, last those that wait for a stop.
    pub fn rank(&self) -> (bool, bool, bool, u64) {
        let stops = self.pending.as_ref().is_some_and(|(_, pending)| is_stop(pending.request()));
        (stops, self.is_waiting(), self.has_requested, self.used_ns)
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        let Self { pending, reload, pending_file, ride, .. } = self;
        let requests = [
            pending.take().map(|(request, _)| request),
            reload.take().map(|(request, _)| request),
            ride.take().map(|(request, _)| request),
            pending_file.take().map(|(request, _)| request),
        ];
        requests.into_iter().flatten().for_each(OpenRequest::forget);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead as _, BufReader};

    fn pair() -> (UnixStream, Connection) {
        let (client, server) = UnixStream::pair().unwrap();
        (client, Connection::new(server, true, 1, 0).unwrap())
    }

    #[test]
    fn lines_come_one_by_one_however_they_are_cut() {
        let (mut client, mut connection) = pair();
        assert_eq!(connection.peer.process_id, std::process::id() as i32);
        client.write_all(b"one\ntw").unwrap();
        assert_eq!(connection.receive(1), Received::Line("one\n".into()));
        assert_eq!(connection.receive(2), Received::Nothing);
        client.write_all(b"o\nthree\n").unwrap();
        assert_eq!(connection.receive(3), Received::Line("two\n".into()));
        assert!(connection.has_line());
        drop(client);
        assert_eq!(connection.receive(4), Received::Line("three\n".into()));
        assert!(!connection.is_done(5));
        assert_eq!(connection.receive(5), Received::Nothing);
        assert!(connection.is_done(5));
    }

    #[test]
    fn a_line_without_end_and_one_of_other_bytes_are_garbage() {
        let (mut client, mut connection) = pair();
        client.write_all(&[b'x'; MAX_LINE_BYTES + 10]).unwrap();
        assert_eq!(connection.receive(1), Received::Garbage("the line is too long"));
        let (mut client, mut connection) = pair();
        client.write_all(b"\xff\xfe\n").unwrap();
        assert_eq!(connection.receive(1), Received::Garbage("the line is not UTF-8"));
    }

    #[test]
    fn silence_and_half_a_line_have_a_limit_and_a_quiet_client_has_none() {
        let (mut client, mut connection) = pair();
        assert!(!connection.is_done(FIRST_LINE_LIMIT_NS));
        assert!(connection.is_done(FIRST_LINE_LIMIT_NS + 1), "silent from the beginning");
        let mut said = String::new();
        BufReader::new(&client).read_line(&mut said).unwrap();
        assert!(said.contains("closed: no line was complete in time: 120 s for the first"), "{said}");
        client.write_all(b"one\n").unwrap();
        assert_eq!(connection.receive(10), Received::Line("one\n".into()));
        assert!(!connection.is_done(100 * LINE_LIMIT_NS), "a client may send another request later");
        client.write_all(b"ha").unwrap();
        assert_eq!(connection.receive(20), Received::Nothing);
        assert!(connection.is_done(LINE_LIMIT_NS + 21));
    }

    #[test]
    fn a_client_that_does_not_read_is_not_waited_for() {
        let (_client, mut connection) = pair();
        let answer = AnswerLine::invalid("x".repeat(1000));
        let sent = (0..10_000).take_while(|_| connection.send(&answer)).count();
        assert!((1..10_000).contains(&sent), "{sent}");
    }
}
