//! Endpoints of the daemons of this host, of any user, and whether they are trusted.
//!
//! Any user can make a folder, a socket and a record that look like a daemon's. Therefore trust depends on
//! open descriptors only: trusted users own folder, socket and listening process, and no other user may write
//! in the folder.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::connection::{Attempt, Connection, connect};
use super::users::{group_name_or_id, is_trusted, user_name};
use crate::messages::claim::{RECORD_EXTENSION, RunningDaemon, machines_in, running_daemon};
use crate::messages::location::{OTHERS_WRITE_MODE, SYSTEM_FOLDER, daemon_folders, user_id};

/// Extensions of the socket for requests and of the read-only socket.
const SOCKET_EXTENSION: &str = "sock";
const READING_EXTENSION: &str = "read";

/// Largest number of endpoints of users that are not trusted. Another user may have made any number.
const MAX_OTHERS: usize = 32;

/// Place where a daemon listens, or has listened.
#[derive(Clone, Debug)]
pub struct Endpoint {
    /// Name of the machine.
    pub machine: String,
    /// Path of the socket, for messages.
    pub socket: PathBuf,
    /// Owner of the socket; of the folder if there is no socket.
    pub owner: u32,
    /// Whether folder and socket are trusted.
    pub is_trusted: bool,
    /// The daemon recorded there, if its process is visible from here.
    pub daemon: Option<RunningDaemon>,
    /// The opened folder. It does not change with its path.
    folder: Arc<File>,
}

impl Endpoint {
    /// The endpoint of a machine in a folder, if there are a socket or a living daemon.
    fn find(folder: &Path, opened: &Arc<File>, machine: &str) -> Option<Self> {
        let place = opened.metadata().ok()?;
        let socket = fs::symlink_metadata(socket_path(&by_descriptor(opened), machine)).ok();
        let is_socket = socket.as_ref().is_some_and(|found| found.file_type().is_socket());
        let daemon = running_daemon(folder, machine);
        let owner = socket.as_ref().map_or(place.uid(), MetadataExt::uid);
        (is_socket || daemon.is_some()).then(|| Self {
            machine: machine.into(),
            socket: socket_path(folder, machine),
            owner,
            is_trusted: is_trusted(owner) && is_trusted(place.uid()) && place.mode() & OTHERS_WRITE_MODE == 0,
            daemon,
            folder: opened.clone(),
        })
    }

    /// Whether the service listens here.
    pub fn is_service(&self) -> bool {
        self.socket.starts_with(SYSTEM_FOLDER)
    }

    /// Whether it belongs to this user.
    pub fn is_own(&self) -> bool {
        self.owner == user_id()
    }

    /// Connects without waiting.
    pub fn connect(&self) -> io::Result<Attempt> {
        connect(&socket_path(&by_descriptor(&self.folder), &self.machine))
    }

    /// Connects to read the status, even if this user may send no requests.
    pub fn connect_to_read(&self) -> io::Result<Attempt> {
        match self.connect()? {
            Attempt::Forbidden => {
                match connect(&reading_path(&by_descriptor(&self.folder), &self.machine))? {
                    Attempt::Absent => Ok(Attempt::Forbidden),
                    attempt => Ok(attempt),
                }
            }
            attempt => Ok(attempt),
        }
    }

    /// Whether the daemon at the other end is trusted.
    pub fn counts(&self, connection: &Connection) -> bool {
        self.is_trusted && connection.peer_user_id().is_some_and(is_trusted)
    }

    /// Text of the users that may connect.
    pub fn allowed(&self) -> String {
        let group = fs::metadata(&self.socket).ok().filter(|found| found.mode() & 0o020 != 0);
        let owner = (self.owner != 0).then(|| format!("user {}", user_name(self.owner)));
        let group = group.map(|found| format!("members of group {}", group_name_or_id(found.gid())));
        let users: Vec<_> = owner.into_iter().chain(group).chain(["root".into()]).collect();
        format!("only {} may; operator.group in the machine file names another group", users.join(" and "))
    }
}

/// Path of the socket of a machine in a folder.
pub fn socket_path(folder: &Path, machine: &str) -> PathBuf {
    folder.join(format!("{machine}.{SOCKET_EXTENSION}"))
}

/// Path of the read-only socket of a machine in a folder.
pub fn reading_path(folder: &Path, machine: &str) -> PathBuf {
    folder.join(format!("{machine}.{READING_EXTENSION}"))
}

/// Path of an opened folder, even if it was renamed.
fn by_descriptor(folder: &File) -> PathBuf {
    format!("/proc/self/fd/{}", folder.as_raw_fd()).into()
}

/// Endpoints of a machine, or of all machines of this host. Order: of the service, of this user, of root, of
/// others, whose answers do not count.
pub fn endpoints(machine: Option<&str>) -> Vec<Endpoint> {
    let mut found: Vec<_> =
        daemon_folders().iter().flat_map(|folder| endpoints_in(folder, machine)).collect();
    found.sort_by_key(|it| (!it.is_trusted, !it.is_service(), !it.is_own(), it.machine.clone(), it.owner));
    let trusted = found.iter().filter(|it| it.is_trusted).count();
    found.truncate(trusted + MAX_OTHERS);
    found
}

fn endpoints_in(folder: &Path, machine: Option<&str>) -> Vec<Endpoint> {
    let mut options = OpenOptions::new();
    let opened =
        options.read(true).custom_flags(libc::O_PATH | libc::O_DIRECTORY | libc::O_NOFOLLOW).open(folder);
    let Ok(opened) = opened.map(Arc::new) else { return vec![] };
    let all = || machines_in(folder, &[SOCKET_EXTENSION, RECORD_EXTENSION]);
    let machines = machine.map_or_else(all, |machine| [machine.to_owned()].into());
    machines.iter().filter_map(|machine| Endpoint::find(folder, &opened, machine)).collect()
}
