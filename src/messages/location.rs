//! Location of the shared memory: one private folder per user, and a prefix that no other user can foresee.
//!
//! The folder holds iceoryx2's book-keeping, the locks of the machines and the prefix of the segments in `/dev/shm`. Other
//! users can neither make it nor write in it, and nothing falls back on a folder that they could have made.

use std::env;
use std::fs::{self, DirBuilder, File, OpenOptions, Permissions, TryLockError, metadata, symlink_metadata};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::*;

use super::bus::{PortError, port_error};

/// Folder of the service, which its package makes at boot and gives to its user.
pub const SYSTEM_FOLDER: &str = "/run/hexad";
/// Root's own folder where it has no runtime folder; only root may make it.
pub const ROOT_FOLDER: &str = "/run/hexad-root";
/// Runtime folders of users who are logged in, by user ID.
pub const USER_RUNTIME_FOLDERS: &str = "/run/user";
/// Beginning of the folder of a user without a runtime folder, and of one that a group may enter.
pub const TEMPORARY_FOLDER: &str = "/tmp/hexad-";

/// Folder of iceoryx2's book-keeping.
const BOOKS: &str = "iceoryx2";
/// File with the prefix.
const PREFIX_FILE: &str = "prefix";
/// Random bytes of a prefix: more than anybody can try.
const PREFIX_BYTES: usize = 8;
/// Longest prefix that is read \[bytes\].
const MAX_PREFIX_BYTES: u64 = 64;
pub(super) const SEGMENTS: &str = "/dev/shm";

/// A port that cannot be opened must not block the I/O thread for the default second.
const CREATION_TIMEOUT: Duration = Duration::from_millis(5);

/// Only the owner may open it: also who may only read could lock it for good.
pub(super) const PRIVATE_FILE: u32 = 0o600;
/// Others may enter it for the control socket and the record beside it, whose own permissions say who may use them.
const USER_FOLDER: u32 = 0o711;
const PRIVATE_FOLDER: u32 = 0o700;
/// Permissions with which others could write in a folder.
const OTHERS_WRITE: u32 = 0o022;

/// User of this process.
pub fn user_id() -> u32 {
    // Root where /proc is not mounted: its folder then has another owner, which is an error.
    metadata("/proc/self").map_or(0, |found| found.uid())
}

/// Folder of this user. The service's own if that belongs to this user, else in the user's runtime folder.
pub fn user_folder() -> PathBuf {
    let user_id = user_id();
    let is_own = |folder: &Path| {
        folder.is_absolute() && metadata(folder).is_ok_and(|found| found.is_dir() && found.uid() == user_id)
    };
    if is_own(Path::new(SYSTEM_FOLDER)) {
        return SYSTEM_FOLDER.into();
    }
    let named = env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let usual = Path::new(USER_RUNTIME_FOLDERS).join(user_id.to_string());
    match named.into_iter().chain([usual]).find(|folder| is_own(folder)) {
        Some(folder) => folder.join("hexad"),
        None if user_id == 0 => ROOT_FOLDER.into(),
        None => format!("{TEMPORARY_FOLDER}{user_id}").into(),
    }
}

/// Makes the folder of this user if it is missing; an error if it could be another user's.
pub fn open_user_folder() -> Result<PathBuf, PortError> {
    let folder = user_folder();
    make_user_folder(&folder).map_err(port_error(format!("cannot make {}", folder.display())))?;
    Ok(folder)
}

/// Makes a folder in which only this user may write, if it is missing; an error if it could be another user's.
pub fn make_user_folder(folder: &Path) -> io::Result<()> {
    make_own(folder, USER_FOLDER)
}

fn make_own(folder: &Path, mode: u32) -> io::Result<()> {
    match DirBuilder::new().mode(mode).create(folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(error),
        // Whatever the mask of this process.
        Ok(()) => fs::set_permissions(folder, Permissions::from_mode(mode))?,
        Err(_) => {}
    }
    let found = symlink_metadata(folder)?;
    if found.is_dir() && found.uid() == user_id() && found.mode() & OTHERS_WRITE == 0 {
        return Ok(());
    }
    Err(io::Error::other(
        "it must be a folder of this user in which nobody else may write; remove it, or set XDG_RUNTIME_DIR to a \
         private folder",
    ))
}

/// Opens a file of this user alone, following no link.
pub(super) fn open_private(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).mode(PRIVATE_FILE);
    options.custom_flags(libc::O_NOFOLLOW).open(path)
}

/// Location of this user's shared memory, held until a node is created there.
pub(super) struct Location {
    /// For iceoryx2.
    pub config: Config,
    /// Held shared: meanwhile no daemon replaces the prefix.
    _prefix: File,
}

impl Location {
    /// Location of this user; makes it if it is missing.
    pub(super) fn open() -> Result<Self, PortError> {
        let folder = open_user_folder()?;
        let path = folder.join(PREFIX_FILE);
        let (prefix, text) =
            open_prefix(&path).map_err(port_error(format!("cannot use {}", path.display())))?;
        let books = folder.join(BOOKS);
        make_own(&books, PRIVATE_FOLDER).map_err(port_error(format!("cannot make {}", books.display())))?;
        Ok(Self { config: config(&books, &text)?, _prefix: prefix })
    }

    /// Why nothing can be created here, in the words of the system; `None` if something can.
    pub(super) fn obstacle(&self) -> Option<String> {
        let root = self.config.global.root_path().to_string();
        let probe = Path::new(&root).join(format!("probe-{}", std::process::id()));
        let written = fs::write(&probe, [0; 1]);
        let _ = fs::remove_file(&probe);
        written.err().map(|error| format!("{root}: {error}"))
    }
}

/// Opens the file of the prefix, locked shared, and reads it. The first participant chooses the prefix.
fn open_prefix(path: &Path) -> io::Result<(File, String)> {
    let mut file = open_private(path)?;
    loop {
        file.lock_shared()?;
        let text = read_prefix(&file)?;
        if !text.is_empty() {
            return Ok((file, text));
        }
        file.lock()?;
        // Another may have chosen meanwhile.
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

/// Chooses another prefix and removes what the old one has left, unless a participant of this user lives: another user may
/// have seen the old one in `/dev/shm` and made files of names that are to come.
pub(super) fn renew_prefix() -> Result<(), PortError> {
    let folder = open_user_folder()?;
    let path = folder.join(PREFIX_FILE);
    let failed = || port_error(format!("cannot renew {}", path.display()));
    let mut file = open_private(&path).map_err(failed())?;
    match file.try_lock() {
        Ok(()) => {}
        // A participant is about to join.
        Err(TryLockError::WouldBlock) => return Ok(()),
        Err(TryLockError::Error(error)) => return Err(failed()(error)),
    }
    let (old, books) = (read_prefix(&file).map_err(failed())?, folder.join(BOOKS));
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

/// Whether a process takes part, or one about which nothing is known.
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
    let entries = fs::read_dir(SEGMENTS).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix)) {
        // Of another user: it can stay, as nobody uses the prefix any more.
        let _ = fs::remove_file(entry.path());
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
            assert!(make_user_folder(&path).is_err(), "{}", path.display());
        }
    }
}
