//! Where the daemon of a machine listens, and a connection to it.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::sys::socket::{
    AddressFamily, SockFlag, SockType, UnixAddr, connect, getsockopt, socket, sockopt::PeerCredentials,
};
use nix::unistd::{Gid, Group, geteuid};

use crate::daemon::control_socket::location::socket_path;
use crate::daemon::control_socket::protocol::{AnswerLine, RequestLine};
use crate::daemon::control_socket::user_name;
use crate::messages::claim::{RunningDaemon, running_daemons};
use crate::messages::location::SYSTEM_FOLDER;
use crate::realtime::file_passing;

/// Longest sleep in a read, so that signals are noticed.
const READ_INTERVAL: Duration = Duration::from_millis(20);

/// Longest answer \[bytes\]: many times that to `status`.
const MAX_ANSWER_BYTES: usize = 1 << 16;

/// Place where a daemon may listen.
#[derive(Clone, Debug)]
pub struct Endpoint {
    pub socket: PathBuf,
    /// The daemon that has recorded it; `None` if no record can be read.
    pub daemon: Option<RunningDaemon>,
}

impl From<RunningDaemon> for Endpoint {
    fn from(daemon: RunningDaemon) -> Self {
        Self { socket: daemon.socket.clone(), daemon: Some(daemon) }
    }
}

/// Result of an attempt to connect.
pub enum Attempt {
    Connected(Connection),
    /// The permissions do not allow it.
    Forbidden,
    /// Nobody listens.
    Absent,
}

/// Places where the daemon of a machine may listen: that of the service first, then those of this user, of root and of
/// others.
pub fn endpoints(machine: &str) -> Vec<Endpoint> {
    let mut daemons = running_daemons(machine);
    let user_id = geteuid().as_raw();
    daemons.sort_by_key(|daemon| (daemon.user_id != user_id, daemon.user_id));
    let system = socket_path(Path::new(SYSTEM_FOLDER), machine);
    let (of_system, others): (Vec<_>, Vec<_>) =
        daemons.into_iter().map(Endpoint::from).partition(|endpoint| endpoint.socket == system);
    let mut found = of_system;
    if found.is_empty() && fs::symlink_metadata(&system).is_ok() {
        found.push(Endpoint { socket: system, daemon: None });
    }
    found.extend(others);
    found
}

impl Endpoint {
    /// Connects, without ever waiting.
    pub fn connect(&self) -> io::Result<Attempt> {
        let flags = SockFlag::SOCK_NONBLOCK | SockFlag::SOCK_CLOEXEC;
        let file = socket(AddressFamily::Unix, SockType::Stream, flags, None)?;
        match connect(file.as_raw_fd(), &UnixAddr::new(&self.socket)?) {
            Ok(()) => Ok(Attempt::Connected(Connection::new(UnixStream::from(file))?)),
            Err(Errno::EACCES | Errno::EPERM) => Ok(Attempt::Forbidden),
            // EAGAIN: the daemon accepts nobody any more.
            Err(Errno::ENOENT | Errno::ECONNREFUSED | Errno::ENOTDIR | Errno::EAGAIN) => Ok(Attempt::Absent),
            Err(error) => Err(error.into()),
        }
    }

    /// Users that may connect, in words.
    pub fn allowed(&self) -> String {
        let found = fs::metadata(&self.socket).ok();
        let owner =
            found.as_ref().map(MetadataExt::uid).or(self.daemon.as_ref().map(|daemon| daemon.user_id));
        let group = found.filter(|found| found.mode() & 0o020 != 0).map(|found| found.gid());
        let owner =
            owner.filter(|user_id| *user_id != 0).map(|user_id| format!("user {}", user_name(user_id)));
        let group = group.map(|group_id| format!("members of group {}", group_name(group_id)));
        let users: Vec<_> = owner.into_iter().chain(group).chain(["root".into()]).collect();
        format!("only {} may; operator.group in the machine file names another group", users.join(" and "))
    }
}

fn group_name(group_id: u32) -> String {
    let found = Group::from_gid(Gid::from_raw(group_id)).ok().flatten();
    found.map_or_else(|| group_id.to_string(), |group| group.name)
}

/// Connection to a daemon.
pub struct Connection {
    stream: UnixStream,
    buffer: Vec<u8>,
}

impl Connection {
    fn new(stream: UnixStream) -> io::Result<Self> {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(READ_INTERVAL))?;
        stream.set_write_timeout(Some(READ_INTERVAL))?;
        Ok(Self { stream, buffer: Vec::new() })
    }

    /// Process of the daemon, from the kernel.
    pub fn process_id(&self) -> Option<u32> {
        let found = getsockopt(&self.stream, PeerCredentials).ok()?;
        u32::try_from(found.pid()).ok().filter(|process_id| *process_id > 0)
    }

    /// Sends a request.
    pub fn send(&mut self, line: &RequestLine) -> io::Result<()> {
        let text = serde_json::to_string(line)? + "\n";
        self.stream.write_all(text.as_bytes())
    }

    /// Sends a request with a file to write.
    pub fn send_with(&mut self, line: &RequestLine, file: &File) -> io::Result<()> {
        let text = serde_json::to_string(line)? + "\n";
        let count = file_passing::send(&self.stream, text.as_bytes(), file)?;
        self.stream.write_all(text.as_bytes().get(count..).unwrap_or_default())
    }

    /// The next line of the daemon; `None` if none came until an instant or until `stop`.
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
