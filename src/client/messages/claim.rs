//! Claim of a machine: the lock that makes one daemon the only one, and the record by which commands find it.
//!
//! The lock is in the owner's private folder: no other user can hold it, and every process of the user finds it. The
//! record is beside the control socket. Everybody who may use the socket may read it; it is valid while its process lives.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions, Permissions, TryLockError, metadata, symlink_metadata};
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};

use super::bus::{PortError, port_error};
use super::location::{
    PRIVATE_FILE, SYSTEM_FOLDER, daemon_folders, entries, make_user_folder, open_private, renew_prefix,
    service_user_id, user_folders, user_id,
};

/// End of the name of a record.
pub const RECORD_EXTENSION: &str = "daemon";

/// Longest record that is read \[bytes\].
const MAX_RECORD_BYTES: u64 = 512;

/// Everybody may read the record; only the owner may write.
const RECORD_MODE: u32 = 0o644;

/// Index of the start time in `/proc/PID/stat`, counted from the state after the name of the process.
const START_TIME_PLACE: usize = 19;

/// Claim of this process to control a machine, until it is dropped or the process dies.
///
/// Without it, a second daemon could take over the topics, and the first one's forces would be ignored for
/// good.
#[derive(Debug)]
pub struct Claim {
    _locks: Vec<File>,
    record: Option<PathBuf>,
}

/// A running daemon, by its record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunningDaemon {
    /// Name of the machine.
    pub machine: String,
    /// Process ID.
    pub process_id: u32,
    /// Start of the process, in clock ticks since boot.
    pub start_ticks: u64,
    /// User of the process.
    pub user_id: u32,
    /// Its control socket.
    pub socket: PathBuf,
    /// Processors to which its threads are bound.
    pub processors: Vec<usize>,
}

impl Claim {
    /// Claims a machine. An error if another daemon of this user, of the service or of root controls it.
    /// Daemons of other users do not count: they reach no participant of this user, and could block the
    /// machine for good.
    pub fn take(machine: &str) -> Result<Self, PortError> {
        make_user_folder()?;
        let (mut folders, system_user) = (user_folders(), service_user_id());
        let system = PathBuf::from(SYSTEM_FOLDER);
        if user_id() == 0 && !folders.contains(&system) && system_user.is_some() {
            folders.push(system);
        }
        let locks = folders.iter().map(|folder| lock(folder, machine)).collect::<Result<_, _>>()?;
        let counts = |daemon: &RunningDaemon| [Some(0), system_user].contains(&Some(daemon.user_id));
        if let Some(other) = running_daemons(machine).into_iter().find(counts) {
            let (process_id, user_id) = (other.process_id, other.user_id);
            return Err(refusal(machine, &format!("process {process_id} of user {user_id} does")));
        }
        renew_prefix()?;
        Ok(Self { _locks: locks, record: None })
    }

    /// Records this process beside its control socket, with the processors to which its threads are bound. An
    /// error if the daemon of another machine is bound to one of them. As with [`Self::take`], daemons of
    /// other users do not count.
    pub fn record(&mut self, socket: &Path, processors: &[usize]) -> Result<(), PortError> {
        let path = record_path(socket);
        let process_id = std::process::id();
        let written = start_ticks_since_boot(process_id)
            .and_then(|start_time| write_record(&path, &record_text(process_id, start_time, processors)));
        written.map_err(port_error(format!("cannot write {}", path.display())))?;
        self.record = Some(path);
        // After its own record is written, so that of two daemons that start together at least one finds the
        // other.
        let users = [Some(user_id()), Some(0), service_user_id()];
        let others = all_running_daemons().into_iter().filter(|other| other.process_id != process_id);
        let shared = others.filter(|other| users.contains(&Some(other.user_id))).find_map(|other| {
            let processor = processors.iter().find(|it| other.processors.contains(it))?;
            Some((*processor, other))
        });
        shared.map_or(Ok(()), |(processor, other)| {
            let RunningDaemon { machine, process_id, .. } = other;
            Err(PortError::new(
                format!("cannot use processor {processor}"),
                format!("{machine} does (process {process_id}); give each machine its own [realtime] cpu and io_cpu"),
            ))
        })
    }
}

/// Text of a record.
fn record_text(process_id: u32, start_time: u64, processors: &[usize]) -> String {
    let processors: Vec<_> = processors.iter().map(usize::to_string).collect();
    format!("{process_id}\n{start_time}\n{}\n", processors.join(","))
}

impl Drop for Claim {
    fn drop(&mut self) {
        if let Some(path) = &self.record {
            // Fails only if somebody has removed the file.
            let _ = fs::remove_file(path);
        }
    }
}

fn refusal(machine: &str, reason: &str) -> PortError {
    PortError::new(format!("cannot control {machine}"), format!("another daemon does ({reason})"))
}

/// Locks a machine in a folder.
fn lock(folder: &Path, machine: &str) -> Result<File, PortError> {
    let path = folder.join(format!("{machine}.lock"));
    let file = open_lock(folder, &path).map_err(port_error(format!("cannot open {}", path.display())))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(refusal(machine, &format!("{} is locked", path.display()))),
        Err(TryLockError::Error(error)) => Err(port_error(format!("cannot lock {}", path.display()))(error)),
    }
}

/// A lock that root makes in another user's folder belongs to that user.
fn open_lock(folder: &Path, path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    let made = options.read(true).write(true).create_new(true).mode(PRIVATE_FILE).open(path);
    match made {
        Ok(file) => {
            let owner = metadata(folder)?;
            if owner.uid() != user_id() {
                fchown(&file, Some(owner.uid()), Some(owner.gid()))?;
            }
            Ok(file)
        }
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => open_private(path),
        Err(error) => Err(error),
    }
}

fn record_path(socket: &Path) -> PathBuf {
    socket.with_extension(RECORD_EXTENSION)
}

/// Writes under a temporary name and renames the file, so that a record appears as a whole.
fn write_record(path: &Path, text: &str) -> io::Result<()> {
    let temporary = path.with_extension(format!("daemon-{}", std::process::id()));
    let _ = fs::remove_file(&temporary);
    let mut options = OpenOptions::new();
    let mut file = options.write(true).create_new(true).open(&temporary)?;
    let written = file
        .set_permissions(Permissions::from_mode(RECORD_MODE))
        .and_then(|()| file.write_all(text.as_bytes()))
        .and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// Daemons that run on this host, of every user whose record can be read, by name of their machine.
fn all_running_daemons() -> Vec<RunningDaemon> {
    let mut found = vec![];
    for folder in daemon_folders() {
        let machines = machines_in(&folder, &[RECORD_EXTENSION]);
        found.extend(machines.iter().filter_map(|machine| running_daemon(&folder, machine)));
    }
    found.sort_by(|a, b| a.machine.cmp(&b.machine).then(a.process_id.cmp(&b.process_id)));
    found
}

/// Names of the files of a folder with one of these extensions, without it, each once.
pub fn machines_in(folder: &Path, extensions: &[&str]) -> BTreeSet<String> {
    let is_one =
        |path: &PathBuf| path.extension().is_some_and(|found| extensions.iter().any(|it| found == *it));
    let files = entries(folder).filter(is_one);
    files.filter_map(|path| path.file_stem().map(|name| name.to_string_lossy().into_owned())).collect()
}

/// Daemons that run for a machine, of every user whose record can be read.
pub fn running_daemons(machine: &str) -> Vec<RunningDaemon> {
    daemon_folders().iter().filter_map(|folder| running_daemon(folder, machine)).collect()
}

/// The daemon of a record. Its process must live, and folder, file and process must belong to one user, or
/// file and process to root.
pub fn running_daemon(folder: &Path, machine: &str) -> Option<RunningDaemon> {
    let folder_owner = symlink_metadata(folder).ok().filter(fs::Metadata::is_dir)?.uid();
    let path = folder.join(format!("{machine}.{RECORD_EXTENSION}"));
    let mut options = OpenOptions::new();
    let file = options.read(true).custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK).open(&path).ok()?;
    let owner = file.metadata().ok().filter(fs::Metadata::is_file)?.uid();
    let mut text = String::new();
    file.take(MAX_RECORD_BYTES).read_to_string(&mut text).ok()?;
    let mut lines = text.lines();
    let process_id = lines.next()?.parse().ok()?;
    let recorded_start: u64 = lines.next()?.parse().ok()?;
    // Empty if no thread is bound.
    let list = lines.next().unwrap_or_default();
    let processors = list.split(',').filter_map(|number| number.parse().ok()).collect();
    let socket = path.with_extension("sock");
    let is_alive = start_ticks_since_boot(process_id).is_ok_and(|started| started == recorded_start);
    let is_of_one_user = process_user(process_id)? == owner && [folder_owner, 0].contains(&owner);
    let machine = machine.to_owned();
    let found = RunningDaemon {
        machine,
        process_id,
        start_ticks: recorded_start,
        user_id: owner,
        socket,
        processors,
    };
    (is_alive && is_of_one_user).then_some(found)
}

/// Start of a process in clock ticks since boot. Together with the process ID it identifies the process for
/// good.
pub fn start_ticks_since_boot(process_id: u32) -> io::Result<u64> {
    let text = fs::read_to_string(format!("/proc/{process_id}/stat"))?;
    // The name may contain any character, even spaces and parentheses.
    let fields = text.rsplit_once(')').map_or("", |(_, fields)| fields);
    let start = fields.split_whitespace().nth(START_TIME_PLACE).and_then(|field| field.parse().ok());
    start.ok_or_else(|| io::Error::other("no start time"))
}

/// Effective user of a process. `/proc` shows root as the owner if the process may not be traced.
fn process_user(process_id: u32) -> Option<u32> {
    let text = fs::read_to_string(format!("/proc/{process_id}/status")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("Uid:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_found_while_its_claim_lives() {
        let machine = format!("claim-test-{}", std::process::id());
        assert_eq!(running_daemons(&machine), []);
        let mut claim = Claim::take(&machine).unwrap();
        assert_eq!(running_daemons(&machine), [], "nothing is recorded yet");
        let socket = make_user_folder().unwrap().join(format!("{machine}.sock"));
        let processors = vec![1022, 1023];
        claim.record(&socket, &processors).unwrap();
        let (process_id, user_id) = (std::process::id(), user_id());
        let expected = RunningDaemon {
            machine: machine.clone(),
            process_id,
            start_ticks: start_ticks_since_boot(process_id).unwrap(),
            user_id,
            socket: socket.clone(),
            processors,
        };
        assert_eq!(running_daemons(&machine), core::slice::from_ref(&expected));
        assert!(all_running_daemons().contains(&expected));
        let (lock, record) = (socket.with_extension("lock"), record_path(&socket));
        assert_eq!(metadata(&lock).unwrap().mode() & 0o777, PRIVATE_FILE, "others must not lock it");
        assert_eq!(metadata(&record).unwrap().mode() & 0o777, RECORD_MODE);
        let refused = Claim::take(&machine).unwrap_err().to_string();
        assert!(refused.contains("another daemon does"), "{refused}");
        drop(claim);
        assert_eq!(running_daemons(&machine), []);
        fs::remove_file(lock).unwrap();
    }

    #[test]
    fn a_record_of_a_process_that_has_ended_does_not_count() {
        let machine = format!("dead-test-{}", std::process::id());
        let folder = make_user_folder().unwrap();
        let path = folder.join(format!("{machine}.daemon"));
        let process_id = std::process::id();
        let started = start_ticks_since_boot(process_id).unwrap();
        for (start, is_found) in [(started, true), (started + 1, false)] {
            write_record(&path, &record_text(process_id, start, &[])).unwrap();
            assert_eq!(running_daemons(&machine).len(), usize::from(is_found), "{start}");
        }
        fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_record_of_another_users_process_does_not_count() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("foreign.daemon");
        // Another user's process, or for root another user's record.
        let process_id = if user_id() == 0 { std::process::id() } else { 1 };
        let record = record_text(process_id, start_ticks_since_boot(process_id).unwrap(), &[]);
        write_record(&path, &record).unwrap();
        if user_id() == 0 {
            assert!(running_daemon(folder.path(), "foreign").is_some(), "before it is another user's");
            std::os::unix::fs::chown(&path, Some(1), None).unwrap();
        }
        assert_eq!(running_daemon(folder.path(), "foreign"), None);
    }
}
