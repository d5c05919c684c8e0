//! Location of the shared memory: a private folder per user, and a prefix that other users cannot predict.
//!
//! The folder contains the files of iceoryx2, the locks of the machines and the prefix of the segments in
//! `/dev/shm`. Other users can neither make it nor write in it. It depends on the user only and on no
//! environment variable, because all processes of a user must find the same locks and the same shared memory,
//! however they were started.

use std::fs::{self, DirBuilder, File, OpenOptions, Permissions, TryLockError, metadata, symlink_metadata};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::*;

use super::bus::{PortError, port_error};

/// Folder of the service. Its package creates the folder at boot and gives it to the service's user.
pub const SYSTEM_FOLDER: &str = "/run/hexad";
/// Root's own folder if root does not own the service's. Only root may make it.
pub const ROOT_FOLDER: &str = "/run/hexad-root";
/// Parent of other users' folders, and prefix of their names. The runtime folder of a login is not used,
/// because it disappears with its sessions.
const TEMPORARY: &str = "/tmp";
const TEMPORARY_NAME: &str = "hexad-";

/// Folder for the files of iceoryx2.
pub(super) const ICEORYX_FOLDER: &str = "iceoryx2";
/// File with the prefix.
const PREFIX_FILE: &str = "prefix";
/// Random bytes of a prefix, too many to try.
const PREFIX_BYTES: usize = 8;
/// Longest prefix that is read \[bytes\].
const MAX_PREFIX_BYTES: u64 = 64;
pub(super) const SEGMENT_FOLDER: &str = "/dev/shm";

/// A port that cannot be opened must not block the I/O thread for the default second.
const CREATION_TIMEOUT: Duration = Duration::from_millis(5);

/// Only the owner may open the file. A user who may read it could lock it for good.
pub(super) const PRIVATE_FILE: u32 = 0o600;
/// Others may enter the folder and see which machines run. The permissions of the control sockets decide who
/// may use them.
const USER_FOLDER: u32 = 0o755;
const PRIVATE_FOLDER: u32 = 0o700;
/// Permissions that let others write in a folder.
pub const OTHERS_WRITE_MODE: u32 = 0o022;

/// User of this process.
pub fn user_id() -> u32 {
    // If /proc is not mounted this is root. Then the folder has another owner, which is an error.
    metadata("/proc/self").map_or(0, |found| found.uid())
}

/// Folder of this user: the service's if it belongs to this user, root's for root, else the first of
/// [`user_folders`].
pub fn user_folder() -> PathBuf {
    match (metadata(SYSTEM_FOLDER), user_id()) {
        (Ok(found), user_id) if found.is_dir() && found.uid() == user_id => SYSTEM_FOLDER.into(),
        (_, 0) => ROOT_FOLDER.into(),
        (_, user_id) => own_folders(user_id).into_iter().next().unwrap_or_else(|| temporary(user_id, 0)),
    }
}

/// All folders of this user. There are several if another user has made, and later removed, a folder with
/// this user's name.
pub fn user_folders() -> Vec<PathBuf> {
    let first = user_folder();
    let others = own_folders(user_id()).into_iter().filter(|folder| *folder != first);
    core::iter::once(first.clone()).chain(others).collect()
}

/// Folders in which daemons of any user may listen.
pub fn daemon_folders() -> Vec<PathBuf> {
    let system = [SYSTEM_FOLDER, ROOT_FOLDER].map(PathBuf::from);
    system.into_iter().chain(temporary_folders(TEMPORARY_NAME)).collect()
}

/// User of the service, if there is one.
pub fn service_user_id() -> Option<u32> {
    metadata(SYSTEM_FOLDER).ok().filter(fs::Metadata::is_dir).map(|found| found.uid())
}

/// Folder of a user, or the next name after `others` folders that belong to other users.
fn temporary(user_id: u32, others: u32) -> PathBuf {
    let end = if others == 0 { String::new() } else { format!("-{others}") };
    Path::new(TEMPORARY).join(format!("{TEMPORARY_NAME}{user_id}{end}"))
}

/// Folders of this user among the temporary files, by name.
fn own_folders(user_id: u32) -> Vec<PathBuf> {
    let first = temporary(user_id, 0);
    let others = temporary_folders(&format!("{TEMPORARY_NAME}{user_id}-"));
    core::iter::once(first).chain(others).filter(|folder| is_own(folder)).collect()
}

fn temporary_folders(beginning: &str) -> Vec<PathBuf> {
    let mut found: Vec<_> = entries_with(TEMPORARY, beginning).collect();
    found.sort();
    found
}

/// Entries of a folder; none if it cannot be read.
pub fn entries(folder: impl AsRef<Path>) -> impl Iterator<Item = PathBuf> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path())
}

fn entries_with(folder: &str, beginning: &str) -> impl Iterator<Item = PathBuf> {
    entries(folder).filter(move |path| {
        path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(beginning))
    })
}

/// Makes the folder of this user if it is missing, whatever folders other users have made.
pub fn make_user_folder() -> Result<PathBuf, PortError> {
    let mut folder = user_folder();
    for others in 1.. {
        let is_temporary = folder.parent() == Some(Path::new(TEMPORARY));
        match make_own(&folder, USER_FOLDER) {
            Ok(()) => break,
            // The folder of another user. Nobody can take all names.
            Err(_) if is_temporary && symlink_metadata(&folder).is_ok() => {
                folder = temporary(user_id(), others)
            }
            Err(cause) => return Err(port_error(format!("cannot make {}", folder.display()))(cause)),
        }
    }
    Ok(folder)
}

fn make_own(folder: &Path, mode: u32) -> io::Result<()> {
    match DirBuilder::new().mode(mode).create(folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(error),
        // Independent of the umask of this process.
        Ok(()) => fs::set_permissions(folder, Permissions::from_mode(mode))?,
        Err(_) => {}
    }
    if is_own(folder) {
        return Ok(());
    }
    Err(io::Error::other("it must be a folder of this user in which nobody else may write; remove it"))
}

fn is_own(folder: &Path) -> bool {
    symlink_metadata(folder).is_ok_and(|found| {
        found.is_dir() && found.uid() == user_id() && found.mode() & OTHERS_WRITE_MODE == 0
    })
}

/// Opens a file that belongs to this user alone. Follows no link.
pub(super) fn open_private(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).mode(PRIVATE_FILE);
    options.custom_flags(libc::O_NOFOLLOW).open(path)
}

/// Location of this user's shared memory, kept until a node is created there.
pub(super) struct Location {
    /// Configuration of iceoryx2.
    pub config: Config,
    /// Lock of the prefix file, shared. While it is held no daemon replaces the prefix.
    _prefix: File,
}

impl Location {
    /// Location of this user. Makes it if it is missing.
    pub(super) fn open() -> Result<Self, PortError> {
        let folder = make_user_folder()?;
        let path = folder.join(PREFIX_FILE);
        let (prefix, text) =
            open_prefix(&path).map_err(port_error(format!("cannot use {}", path.display())))?;
        let books = folder.join(ICEORYX_FOLDER);
        make_own(&books, PRIVATE_FOLDER).map_err(port_error(format!("cannot make {}", books.display())))?;
        Ok(Self { config: config(&books, &text)?, _prefix: prefix })
    }

    /// Reason why nothing can be created here, as an error of the system; `None` if something can.
    pub(super) fn probe_writing(&self) -> Option<String> {
        let root = self.config.global.root_path().to_string();
        let name = format!("{}probe-{}", self.config.global.prefix, std::process::id());
        [root.as_str(), SEGMENT_FOLDER].into_iter().find_map(|folder| {
            let probe = Path::new(folder).join(&name);
            let written = fs::write(&probe, [0; 1]);
            let _ = fs::remove_file(&probe);
            written.err().map(|error| format!("cannot write in {folder}: {error}"))
        })
    }
}

/// What has happened to shared memory that was deleted under running participants, and what to do.
pub const SEGMENTS_DELETED: &str = "the files of the shared memory in /dev/shm were deleted while it was in use: who runs goes on, and nobody can \
    join. systemd-logind does that when the last session of a user who is no system user ends (RemoveIPC=yes). Stop all participants of this \
    user, set RemoveIPC=no in /etc/systemd/logind.conf, or run them as a system user, then start them again";

/// Whether this user's shared memory is gone from `/dev/shm`. For participants: while one runs, some must
/// exist.
pub fn are_segments_deleted() -> bool {
    let prefix = fs::read_to_string(user_folder().join(PREFIX_FILE)).unwrap_or_default();
    !prefix.is_empty() && entries_with(SEGMENT_FOLDER, &prefix).next().is_none()
}

/// Opens the file of the prefix with a shared lock, and reads it. The first participant chooses the prefix.
fn open_prefix(path: &Path) -> io::Result<(File, String)> {
    let mut file = open_private(path)?;
    loop {
        file.lock_shared()?;
        let text = read_prefix(&file)?;
        if !text.is_empty() {
            return Ok((file, text));
        }
        file.lock()?;
        // Another process may have chosen meanwhile.
        if read_prefix(&file)?.is_empty() {
            file.write_all(new_prefix()?.as_bytes())?;
        }
    }
}

fn read_prefix(file: &File) -> io::Result<String> {
    let mut text = String::new();
    let mut from_start = file.try_clone()?;
    io::Seek::rewind(&mut from_start)?;
    from_start.take(MAX_PREFIX_BYTES).read_to_string(&mut text)?;
    Ok(text)
}

fn new_prefix() -> io::Result<String> {
    let mut bytes = [0; PREFIX_BYTES];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(format!("hexad_{:016x}_", u64::from_ne_bytes(bytes)))
}

fn config(books: &Path, prefix: &str) -> Result<Config, PortError> {
    let bad_name = || port_error::<SemanticStringError>("cannot name the shared memory".into());
    let mut config = Config::default();
    config.global.creation_timeout = CREATION_TIMEOUT;
    let books = books.as_os_str().as_encoded_bytes();
    config.global.set_root_path(&iceoryx2::prelude::Path::new(books).map_err(bad_name())?);
    config.global.prefix = FileName::new(prefix.as_bytes()).map_err(bad_name())?;
    Ok(config)
}

/// Chooses another prefix and removes the segments of the old one, unless a participant of this user lives.
/// Another user may have seen the old prefix in `/dev/shm` and made files with future names.
pub(super) fn renew_prefix() -> Result<(), PortError> {
    let folder = make_user_folder()?;
    let path = folder.join(PREFIX_FILE);
    let failed = || port_error(format!("cannot renew {}", path.display()));
    let mut file = open_private(&path).map_err(failed())?;
    match file.try_lock() {
        Ok(()) => {}
        // A participant is about to join.
        Err(TryLockError::WouldBlock) => return Ok(()),
        Err(TryLockError::Error(error)) => return Err(failed()(error)),
    }
    let (old, books) = (read_prefix(&file).map_err(failed())?, folder.join(ICEORYX_FOLDER));
    if !old.is_empty() {
        if has_participants(&config(&books, &old)?) {
            return Ok(());
        }
        remove_segments(&old);
    }
    let removed = fs::remove_dir_all(&books);
    removed
        .or_else(|error| if error.kind() == ErrorKind::NotFound { Ok(()) } else { Err(error) })
        .and_then(|()| file.set_len(0))
        .and_then(|()| io::Seek::rewind(&mut file))
        .and_then(|()| new_prefix())
        .and_then(|prefix| file.write_all(prefix.as_bytes()))
        .map_err(failed())
}

/// Whether a process takes part. A process whose state cannot be read counts.
fn has_participants(config: &Config) -> bool {
    let mut found = false;
    let listed = Node::<ipc::Service>::list(config, |node| {
        found |= !matches!(node, NodeState::Dead(_));
        if found { CallbackProgression::Stop } else { CallbackProgression::Continue }
    });
    found || listed.is_err()
}

/// Removes the segments of this user with a prefix.
fn remove_segments(prefix: &str) {
    for segment in entries_with(SEGMENT_FOLDER, prefix) {
        // A segment of another user can stay, because nobody uses the prefix any more.
        let _ = fs::remove_file(segment);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    #[test]
    fn a_prefix_is_chosen_once_and_differs_between_users() {
        let [first, second] = [TempDir::new().unwrap(), TempDir::new().unwrap()];
        let prefix = |folder: &TempDir| open_prefix(&folder.path().join(PREFIX_FILE)).unwrap().1;
        assert_eq!(prefix(&first), prefix(&first));
        assert_ne!(prefix(&first), prefix(&second));
        assert_eq!(prefix(&first).len(), "hexad_0123456789abcdef_".len());
    }

    #[test]
    fn a_folder_that_others_may_write_and_a_link_are_refused() {
        use std::os::unix::fs::symlink;
        let parent = TempDir::new().unwrap();
        let [open, link, private] = ["open", "link", "private"].map(|name| parent.path().join(name));
        for _ in 0..2 {
            make_own(&private, PRIVATE_FOLDER).unwrap();
            assert_eq!(metadata(&private).unwrap().mode() & 0o777, PRIVATE_FOLDER);
        }
        fs::create_dir(&open).unwrap();
        fs::set_permissions(&open, Permissions::from_mode(0o777)).unwrap();
        symlink(&private, &link).unwrap();
        for path in [open, link] {
            assert!(make_own(&path, USER_FOLDER).is_err(), "{}", path.display());
        }
    }

    #[test]
    fn a_folder_of_another_user_is_refused() {
        let parent = TempDir::new().unwrap();
        let foreign = if user_id() == 0 {
            let folder = parent.path().join("foreign");
            make_own(&folder, USER_FOLDER).unwrap();
            std::os::unix::fs::chown(&folder, Some(1), None).unwrap();
            folder
        } else {
            // Root owns the folder, and only root may write in it.
            "/usr".into()
        };
        assert_eq!(metadata(&foreign).unwrap().mode() & OTHERS_WRITE_MODE, 0);
        assert!(make_own(&foreign, USER_FOLDER).is_err());
    }
}
