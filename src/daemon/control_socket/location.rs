//! Location and permissions of the control socket.

use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process;

use nix::unistd;

use hexad_client::messages::PortError;
use hexad_client::messages::location::{SYSTEM_FOLDER, make_user_folder};
use hexad_client::operator::endpoint::{reading_path, socket_path};
use hexad_machine::config::deployment::OperatorAccess;

/// Error of opening the control socket.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// The configured group does not exist.
    #[error("operator.{0} = \"{1}\": no such group; create it, or correct the machine file")]
    NoGroup(&'static str, String),
    /// The daemon may not give its socket to the configured group.
    #[error("operator.{0} = \"{1}\": the user of the daemon must be a member of that group")]
    NotMember(&'static str, String),
    /// The folder of this user could not be made.
    #[error(transparent)]
    Folder(#[from] PortError),
    /// The socket could not be made.
    #[error("cannot open the control socket {path}: {cause}")]
    Open {
        /// Its path.
        path: PathBuf,
        /// Error of the operating system.
        cause: io::Error,
    },
}

/// Open control socket; its files are removed when it is dropped.
#[derive(Debug)]
pub struct ControlSocket {
    /// Listener, which does not block.
    pub listener: UnixListener,
    /// Listener for clients that may only read the status.
    pub reading: Option<UnixListener>,
    /// Path of the socket file.
    pub path: PathBuf,
}

impl ControlSocket {
    /// Accepts the next client, and returns whether it may send requests. Clients that may send requests come
    /// first.
    pub fn accept(&self) -> io::Result<(UnixStream, bool)> {
        match (self.listener.accept(), &self.reading) {
            (Err(error), Some(reading)) if error.kind() == io::ErrorKind::WouldBlock => {
                reading.accept().map(|(stream, _)| (stream, false))
            }
            (accepted, _) => accepted.map(|(stream, _)| (stream, true)),
        }
    }
}

impl Drop for ControlSocket {
    fn drop(&mut self) {
        // Fails only if somebody has removed the files.
        for path in
            [Some(self.path.clone()), self.reading.as_ref().map(|_| beside(&self.path))].into_iter().flatten()
        {
            let _ = fs::remove_file(path);
        }
    }
}

/// Path of the read-only socket beside the socket for requests.
fn beside(socket: &Path) -> PathBuf {
    let folder = socket.parent().unwrap_or(socket);
    reading_path(folder, &socket.file_stem().unwrap_or_default().to_string_lossy())
}

/// Opens the control socket of a machine: in [`SYSTEM_FOLDER`] if this process may write there, else in the
/// folder of this user.
pub fn open(machine: &str, access: &OperatorAccess) -> Result<ControlSocket, SocketError> {
    let (group, read_group) =
        (Group::find("group", &access.group)?, Group::find("read_group", &access.read_group)?);
    let in_folder = |folder: &Path| -> Result<ControlSocket, SocketError> {
        let path = socket_path(folder, machine);
        let listener = bind(&path, access.mode, group.as_ref())?;
        let mut socket = ControlSocket { listener, reading: None, path };
        if read_group.is_some() {
            socket.reading = Some(bind(&beside(&socket.path), 0o660, read_group.as_ref())?);
        }
        Ok(socket)
    };
    let system = Path::new(SYSTEM_FOLDER);
    if system.is_dir() {
        match in_folder(system) {
            Err(SocketError::Open { .. }) => {}
            result => return result,
        }
    }
    in_folder(&make_user_folder()?)
}

/// Group named by a key of the configuration.
struct Group {
    key: &'static str,
    name: String,
    id: u32,
}

impl Group {
    fn find(key: &'static str, name: &Option<String>) -> Result<Option<Self>, SocketError> {
        let Some(name) = name.clone() else { return Ok(None) };
        match unistd::Group::from_name(&name).ok().flatten() {
            Some(found) => Ok(Some(Self { key, name, id: found.gid.as_raw() })),
            None => Err(SocketError::NoGroup(key, name)),
        }
    }
}

/// Binds under a temporary name and renames the socket. So it appears with its permissions, and replaces the
/// socket of a daemon that died.
fn bind(path: &Path, mode: u32, group: Option<&Group>) -> Result<UnixListener, SocketError> {
    let temporary = path.with_extension(process::id().to_string());
    let _ = fs::remove_file(&temporary);
    let bound = UnixListener::bind(&temporary).and_then(|listener| {
        listener.set_nonblocking(true)?;
        chown(&temporary, None, group.map(|group| group.id))?;
        fs::set_permissions(&temporary, Permissions::from_mode(mode))?;
        fs::rename(&temporary, path)?;
        Ok(listener)
    });
    bound.map_err(|cause| {
        let _ = fs::remove_file(&temporary);
        match group {
            // EPERM, not EACCES: the user may not change the group.
            Some(Group { key, name, .. }) if cause.raw_os_error() == Some(libc::EPERM) => {
                SocketError::NotMember(key, name.clone())
            }
            _ => SocketError::Open { path: path.into(), cause },
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::MetadataExt;
    use tempfile::TempDir;

    #[test]
    fn a_socket_has_its_permissions_and_replaces_a_dead_one() {
        let folder = TempDir::new().unwrap();
        let path = socket_path(folder.path(), "m");
        for mode in [0o600, 0o660] {
            // Leaves the file of a killed daemon.
            core::mem::forget(bind(&path, 0o666, None).unwrap());
            let listener = bind(&path, mode, None).unwrap();
            let socket = ControlSocket { listener, reading: None, path: path.clone() };
            assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, mode);
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
            drop(socket);
            assert!(!path.exists());
        }
    }

    #[test]
    fn a_group_that_does_not_exist_is_named() {
        let none = Some("no-such-group-here".to_owned());
        for (group, read_group, key) in [(none.clone(), None, "group"), (None, none, "read_group")] {
            let error =
                open("m", &OperatorAccess { group, read_group, mode: 0o660 }).unwrap_err().to_string();
            let words = format!("operator.{key} = \"no-such-group-here\": no such group");
            assert!(error.starts_with(&words), "{error}");
        }
    }
}
