//! Files that are written completely or not at all, and standard output.

use core::fmt;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

/// Error of reading or writing a file, with the path of the file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub struct FileError {
    /// Path of the file, as given.
    pub path: PathBuf,
    /// Error of the operating system or of the file's format.
    pub cause: io::Error,
}

impl FileError {
    /// Converter of an I/O error that names the file.
    pub fn on(path: &Path) -> impl FnOnce(io::Error) -> Self + use<> {
        let path = path.to_path_buf();
        move |cause| Self { path, cause }
    }
}

/// Writes to standard output. A reader that closes its end early, such as `head`, is no error.
pub fn print(text: impl fmt::Display) -> Result<(), FileError> {
    let mut out = io::stdout().lock();
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(FileError::on(Path::new("standard output"))(error))
        }
        _ => Ok(()),
    }
}

/// Writes a line to standard error. Nobody who reads it is no error.
pub fn remark(text: impl fmt::Display) {
    let _ = writeln!(io::stderr(), "hexad: {text}");
}

/// Path that means standard input or output.
const STANDARD: &str = "-";

/// Whether a path means standard input or output.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == STANDARD
}

/// Name of a file to read, for people.
pub fn name_of(path: &Path) -> &Path {
    if is_standard(path) { Path::new("standard input") } else { path }
}

/// Opens a file to read; `-` is standard input.
pub fn open(path: &Path) -> Result<Box<dyn Read>, FileError> {
    if is_standard(path) {
        return Ok(Box::new(io::stdin()));
    }
    File::open(path).map_err(FileError::on(path)).map(|file| Box::new(file) as Box<dyn Read>)
}

/// Writes a value as JSON to standard output, with [`print()`].
pub fn print_json(value: &impl Serialize) -> Result<(), FileError> {
    let json = serde_json::to_string_pretty(value)
        .map_err(|error| FileError::on(Path::new("standard output"))(error.into()))?;
    print(format_args!("{json}\n"))
}

/// Writes a file durably: a crash or a power failure at any instant leaves the old content or the new. `-` is standard
/// output.
pub fn write_whole(path: &Path, content: &[u8]) -> Result<(), FileError> {
    if is_standard(path) {
        return print(String::from_utf8_lossy(content));
    }
    write_whole_with(path, |file| file.write_all(content).map_err(FileError::on(path)))
}

/// Writes a file durably, as [`write_whole`] does, with what `write` writes.
pub fn write_whole_with<E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut File) -> Result<(), E>,
) -> Result<(), E> {
    let mut temporary = path.as_os_str().to_os_string();
    temporary.push(".part");
    let temporary = PathBuf::from(temporary);
    let mut file = File::create(&temporary).map_err(FileError::on(path))?;
    write(&mut file)
        .and_then(|()| Ok(replace(&file, &temporary, path).map_err(FileError::on(path))?))
        .inspect_err(|_| drop(fs::remove_file(&temporary)))
}

/// Writes a value as JSON with [`write_whole`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), FileError> {
    let json = serde_json::to_vec_pretty(value).map_err(|error| FileError::on(path)(error.into()))?;
    write_whole(path, &json)
}

/// Renames a temporary file in the same folder, and makes both the content and the new name durable.
fn replace(file: &File, temporary: &Path, path: &Path) -> io::Result<()> {
    file.sync_all()?;
    fs::rename(temporary, path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn names(folder: &TempDir) -> Vec<PathBuf> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn a_file_is_replaced_as_a_whole() {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("report.json");
        for content in ["a long old content", "new"] {
            write_whole(&path, content.as_bytes()).unwrap();
            assert_eq!((fs::read_to_string(&path).unwrap().as_str(), names(&folder).len()), (content, 1));
        }
        assert!(write_whole(Path::new("no-such-folder/report.json"), b"new").is_err());
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_no_temporary_one() {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("report.json");
        write_whole(&path, b"old").unwrap();
        let error = write_whole_with(&path, |file| {
            let half = file.write_all(b"half of the n");
            // A full disk.
            let full = || File::options().write(true).open("/dev/full")?.write_all(b"ew");
            half.and_then(|()| full()).map_err(FileError::on(&path))
        });
        assert_eq!(error.unwrap_err().cause.kind(), io::ErrorKind::StorageFull);
        assert_eq!((fs::read_to_string(&path).unwrap().as_str(), names(&folder)), ("old", vec![path]));
        // Neither does a target that cannot be replaced.
        let occupied = folder.path().join("folder");
        fs::create_dir_all(occupied.join("inside")).unwrap();
        let error = write_whole(&occupied, b"new").unwrap_err();
        assert!(error.to_string().starts_with(&format!("{}: ", occupied.display())), "{error}");
        assert_eq!(names(&folder).len(), 2);
    }

    /// The folder is one in which not even root can create a file.
    #[test]
    fn a_folder_without_write_access_keeps_its_files() {
        let old = fs::read("/proc/version").unwrap();
        assert!(write_whole(Path::new("/proc/version"), b"new").is_err());
        assert_eq!(fs::read("/proc/version").unwrap(), old);
        assert!(!Path::new("/proc/version.part").exists());
    }
}
