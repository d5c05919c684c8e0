//! Files that are either complete or not there.

use core::fmt;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Could not read or write a file: which, and why.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub struct FileError {
    pub path: PathBuf,
    pub cause: io::Error,
}

impl FileError {
    /// Names the file an operation failed on.
    pub fn on(path: &Path) -> impl FnOnce(io::Error) -> Self + use<> {
        let path = path.to_path_buf();
        move |cause| Self { path, cause }
    }
}

/// Writes to standard output. Who reads it may have read enough: that is no failure.
pub fn print(text: impl fmt::Display) -> Result<(), FileError> {
    let mut out = io::stdout().lock();
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(FileError::on(Path::new("standard output"))(error))
        }
        _ => Ok(()),
    }
}

/// Writes a whole file through a temporary one beside it, so that an interruption leaves the old content
/// or none, never half of the new.
pub fn write_whole(path: &Path, content: &[u8]) -> Result<(), FileError> {
    let mut temporary = path.as_os_str().to_os_string();
    temporary.push(".part");
    let temporary = PathBuf::from(temporary);
    fs::write(&temporary, content)
        .and_then(|()| fs::rename(&temporary, path))
        .inspect_err(|_| drop(fs::remove_file(&temporary)))
        .map_err(FileError::on(path))
}
