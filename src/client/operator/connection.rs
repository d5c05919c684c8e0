//! Connection to a daemon.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::sys::socket::sockopt::{PeerCredentials, PeerPidfd};
use nix::sys::socket::{self, AddressFamily, SockFlag, SockType, UnixAddr, UnixCredentials, getsockopt};

use super::protocol::{AnswerLine, RequestLine};

/// Longest blocking read, so that signals are noticed.
const READ_INTERVAL: Duration = Duration::from_millis(20);

/// Longest answer \[bytes\]: many times the answer to `status`.
const MAX_ANSWER_BYTES: usize = 1 << 16;

/// Result of an attempt to connect.
pub enum Attempt {
    /// Connected.
    Connected(Connection),
    /// The permissions do not allow it.
    Forbidden,
    /// No process listens.
    Absent,
    /// The listening process accepts no more connections now.
    Full,
}

/// Connects without waiting.
pub(super) fn connect(path: &Path) -> io::Result<Attempt> {
    let flags = SockFlag::SOCK_NONBLOCK | SockFlag::SOCK_CLOEXEC;
    let file = socket::socket(AddressFamily::Unix, SockType::Stream, flags, None)?;
    match socket::connect(file.as_raw_fd(), &UnixAddr::new(path)?) {
        Ok(()) => Ok(Attempt::Connected(Connection::new(UnixStream::from(file))?)),
        Err(Errno::EACCES | Errno::EPERM) => Ok(Attempt::Forbidden),
        Err(Errno::EAGAIN) => Ok(Attempt::Full),
        Err(Errno::ENOENT | Errno::ECONNREFUSED | Errno::ENOTDIR) => Ok(Attempt::Absent),
        Err(error) => Err(error.into()),
    }
}

/// Connection to a daemon.
pub struct Connection {
    stream: UnixStream,
    peer: Option<UnixCredentials>,
    buffer: Vec<u8>,
}

impl Connection {
    fn new(stream: UnixStream) -> io::Result<Self> {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(READ_INTERVAL))?;
        stream.set_write_timeout(Some(READ_INTERVAL))?;
        let peer = getsockopt(&stream, PeerCredentials).ok();
        Ok(Self { stream, peer, buffer: Vec::new() })
    }

    /// The stream, for files passed beside the lines.
    pub fn stream(&self) -> &UnixStream {
        &self.stream
    }

    /// User of the process that listens, from the kernel.
    pub fn peer_user_id(&self) -> Option<u32> {
        self.peer.map(|peer| peer.uid())
    }

    /// Process ID of the process that listens; `None` if it is not visible from here.
    pub fn peer_process_id(&self) -> Option<u32> {
        let process_id = self.peer.and_then(|peer| u32::try_from(peer.pid()).ok());
        process_id.filter(|process_id| *process_id > 0)
    }

    /// Descriptor of the process that listens; it never refers to a later process with the same number. `None` if the
    /// kernel does not provide it (before Linux 6.5).
    pub fn process(&self) -> Option<OwnedFd> {
        getsockopt(&self.stream, PeerPidfd).ok()
    }

    /// Sends a request.
    pub fn send(&mut self, line: &RequestLine) -> io::Result<()> {
        self.stream.write_all(line.to_line()?.as_bytes())
    }

    /// The next line of the daemon; `None` if none arrived until an instant or until `stop`.
    pub fn receive(&mut self, until: Instant, stop: impl Fn() -> bool) -> io::Result<Option<AnswerLine>> {
        loop {
            if let Some(end) = self.buffer.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.buffer.drain(..=end).collect();
                return Ok(Some(serde_json::from_slice(&line)?));
            }
            if Instant::now() >= until || stop() {
                return Ok(None);
            }
            let mut bytes = [0; 4096];
            match self.stream.read(&mut bytes) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) if self.buffer.len() + count <= MAX_ANSWER_BYTES => {
                    self.buffer.extend(bytes.iter().take(count));
                }
                Ok(_) => return Err(io::Error::new(ErrorKind::InvalidData, "the answer is too long")),
                Err(error) if is_temporary(&error) => {}
                Err(error) => return Err(error),
            }
        }
    }
}

fn is_temporary(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
