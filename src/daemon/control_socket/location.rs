//! Place and permissions of the control socket.

use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process;

use nix::unistd::{Group, geteuid};

use crate::config::deployment::OperatorAccess;
use crate::messages::location::{SYSTEM_FOLDER, TEMPORARY_FOLDER, make_user_folder, user_folder};

/// Error of opening the control socket.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// The configured group does not exist.
    #[error("operator.group = \"{0}\": no such group; create it, or correct the machine file")]
    NoGroup(String),
    /// The daemon may not give its socket to the configured group.
    #[error("operator.group = \"{0}\": the user of the daemon must be a member of that group")]
    NotMember(String),
    /// A folder or socket could not be made.
    #[error("cannot open the control socket {path}: {cause}")]
    Open {
        /// Socket or folder.
        path: PathBuf,
        /// Error of the operating system.
        cause: io::Error,
    },
}

/// Path of the socket of a machine in a folder.
pub fn socket_path(folder: &Path, machine: &str) -> PathBuf {
    folder.join(format!("{machine}.sock"))
}

/// Open control socket; its file is removed when it is dropped.
#[derive(Debug)]
pub struct ControlSocket {
    /// Listener, which does not block.
    pub listener: UnixListener,
    /// Path of its file.
    pub path: PathBuf,
}

impl Drop for ControlSocket {
    fn drop(&mut self) {
        // Fails only if somebody has removed it.
        let _ = fs::remove_file(&self.path);
    }
}

/// Opens the control socket of a machine: in [`SYSTEM_FOLDER`] if this process may write there, else in a folder of this
/// user.
pub fn open(machine: &str, access: &OperatorAccess) -> Result<ControlSocket, SocketError> {
    let group_id = match &access.group {
        None => None,
        Some(name) => {
            let group = Group::from_name(name).ok().flatten();
            Some(group.ok_or_else(|| SocketError::NoGroup(name.clone()))?.gid.as_raw())
        }
    };
    let bind = |folder: &Path| bind(&socket_path(folder, machine), access.mode, group_id);
    let system = Path::new(SYSTEM_FOLDER);
    let failed = |path: PathBuf, cause: io::Error| match &access.group {
        // Not EACCES: to change the group is not permitted.
        Some(name) if cause.raw_os_error() == Some(libc::EPERM) => SocketError::NotMember(name.clone()),
        _ => SocketError::Open { path, cause },
    };
    if system.is_dir() {
        match bind(system).map_err(|cause| failed(system.into(), cause)) {
            Err(SocketError::Open { .. }) => {}
            result => return result,
        }
    }
    let folder = folder(access);
    make_user_folder(&folder).map_err(|cause| failed(folder.clone(), cause))?;
    bind(&folder).map_err(|cause| failed(socket_path(&folder, machine), cause))
}

/// The user's folder, if nobody else has to enter it, else one among the temporary files.
fn folder(access: &OperatorAccess) -> PathBuf {
    let is_private = access.group.is_none() && !access.is_for_everybody();
    if is_private { user_folder() } else { format!("{TEMPORARY_FOLDER}{}", geteuid()).into() }
}

/// Binds under a temporary name: the socket appears with its permissions, and replaces that of a daemon that died.
fn bind(path: &Path, mode: u32, group_id: Option<u32>) -> io::Result<ControlSocket> {
    let temporary = path.with_extension(format!("{}", process::id()));
    let _ = fs::remove_file(&temporary);
    let listener = UnixListener::bind(&temporary)?;
    let prepared = listener
        .set_nonblocking(true)
        .and_then(|()| group_id.map_or(Ok(()), |group_id| chown(&temporary, None, Some(group_id))))
        .and_then(|()| fs::set_permissions(&temporary, Permissions::from_mode(mode)))
        .and_then(|()| fs::rename(&temporary, path));
    match prepared {
        Ok(()) => Ok(ControlSocket { listener, path: path.into() }),
        Err(error) => {
            let _ = fs::remove_file(&temporary);
            Err(error)
        }
    }
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
            // The file of a daemon that was killed.
            core::mem::forget(bind(&path, 0o666, None).unwrap());
            let socket = bind(&path, mode, None).unwrap();
            assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, mode);
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
            drop(socket);
            assert!(!path.exists());
        }
    }

    #[test]
    fn a_group_that_does_not_exist_is_named() {
        let access = OperatorAccess { group: Some("no-such-group-here".into()), mode: 0o660 };
        let error = open("m", &access).unwrap_err().to_string();
        assert!(error.starts_with("operator.group = \"no-such-group-here\": no such group"), "{error}");
    }
}
