//! Claim of a machine: the lock that makes one daemon the only one, and the record by which commands find it.

use std::fs::{self, File, OpenOptions, Permissions, TryLockError, create_dir_all};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use super::bus::{PortError, location, port_error};

/// Attempts to lock: a command that looks whether the lock is held holds it for a moment itself.
const LOCK_ATTEMPTS: u32 = 10;
const LOCK_INTERVAL: Duration = Duration::from_millis(10);

/// Longest record that is read \[bytes\].
const MAX_RECORD_BYTES: u64 = 512;

/// Everybody may read who controls the machine; only the owner may write.
const FOLDER_MODE: u32 = 0o755;
const FILE_MODE: u32 = 0o644;

/// Claim of this process to control a machine, until it is dropped or the process dies, however it dies.
///
/// Topics alone would let a second daemon take over, and leave the first one's forces ignored for good.
#[derive(Debug)]
pub struct Claim {
    file: File,
    path: PathBuf,
}

/// A running daemon, by its record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunningDaemon {
    /// Number of the process.
    pub process_id: u32,
    /// User of the process.
    pub user_id: u32,
    /// Its control socket.
    pub socket: PathBuf,
}

impl Claim {
    /// Claims a machine; an error if another daemon of this user controls it.
    pub fn take(machine: &str) -> Result<Self, PortError> {
        let folder = PathBuf::from(location()?.0.global.root_path().to_string());
        let path = folder.join(file_name(machine));
        let file = open_folder(&folder).and_then(|()| {
            // Not truncated: it may be the record of another.
            let mut options = OpenOptions::new();
            options.read(true).write(true).create(true).truncate(false).mode(FILE_MODE).open(&path)
        });
        let file = file.map_err(port_error(format!("cannot open {}", path.display())))?;
        for _ in 0..LOCK_ATTEMPTS {
            match file.try_lock() {
                Ok(()) => {
                    let mut claim = Self { file, path };
                    claim.write("").map_err(port_error(format!("cannot write {}", claim.path.display())))?;
                    return Ok(claim);
                }
                Err(TryLockError::WouldBlock) => sleep(LOCK_INTERVAL),
                Err(error) => return Err(port_error(format!("cannot lock {}", path.display()))(error)),
            }
        }
        let what = format!("cannot control {machine}");
        Err(PortError::new(what, format!("another daemon does ({} is locked)", path.display())))
    }

    /// Records this process and its control socket.
    pub fn record(&mut self, socket: &Path) -> Result<(), PortError> {
        let text = format!("{}\n{}\n", std::process::id(), socket.display());
        self.write(&text).map_err(port_error(format!("cannot write {}", self.path.display())))
    }

    fn write(&mut self, text: &str) -> io::Result<()> {
        self.file.set_len(0)?;
        self.file.rewind()?;
        self.file.set_permissions(Permissions::from_mode(FILE_MODE))?;
        self.file.write_all(text.as_bytes())
    }
}

/// Folder of the lock, which other users may enter whatever the mask of the process that makes it.
fn open_folder(folder: &Path) -> io::Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    create_dir_all(folder)?;
    fs::set_permissions(folder, Permissions::from_mode(FOLDER_MODE))
}

fn file_name(machine: &str) -> String {
    format!("hexad-{machine}.lock")
}

/// Daemons that run for a machine, of every user whose record can be read.
pub fn running_daemons(machine: &str) -> Vec<RunningDaemon> {
    let Ok((config, _)) = location() else { return vec![] };
    let own = PathBuf::from(config.global.root_path().to_string());
    let Some(parent) = own.parent() else { return vec![] };
    let usual = iceoryx2::config::Config::default().global.root_path().to_string();
    let usual = Path::new(&usual).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let entries = fs::read_dir(parent).into_iter().flatten().flatten();
    let folders = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&usual));
    folders.filter_map(|folder| running_daemon(&folder.path(), machine)).collect()
}

/// The daemon of a record, if its lock is held and folder, file and process are of one user.
fn running_daemon(folder: &Path, machine: &str) -> Option<RunningDaemon> {
    let owner = fs::symlink_metadata(folder).ok().filter(fs::Metadata::is_dir)?.uid();
    let path = folder.join(file_name(machine));
    let mut file =
        OpenOptions::new().read(true).custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK).open(path).ok()?;
    if !matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
        return None;
    }
    let mut text = String::new();
    (&mut file).take(MAX_RECORD_BYTES).read_to_string(&mut text).ok()?;
    let (process_id, socket) = text.trim_end().split_once('\n')?;
    let process_id = process_id.parse().ok()?;
    let process_owner = fs::metadata(format!("/proc/{process_id}")).ok()?.uid();
    let is_of_one_user = [file.metadata().ok()?.uid(), process_owner].iter().all(|user| *user == owner);
    is_of_one_user.then(|| RunningDaemon { process_id, user_id: owner, socket: socket.into() })
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
        claim.record(Path::new("/run/x.sock")).unwrap();
        let user_id = fs::metadata("/proc/self").unwrap().uid();
        let expected =
            RunningDaemon { process_id: std::process::id(), user_id, socket: "/run/x.sock".into() };
        assert_eq!(running_daemons(&machine), [expected]);
        let path = claim.path.clone();
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, FILE_MODE);
        drop(claim);
        assert_eq!(running_daemons(&machine), [], "the lock is free");
        fs::remove_file(path).unwrap();
    }
}
