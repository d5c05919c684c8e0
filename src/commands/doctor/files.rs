//! Kernel files that describe the host, read under a root that a test can replace.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Root of the files that describe a host: `/proc`, `/sys`, `/boot`.
#[derive(Clone, Debug)]
pub struct HostFiles {
    root: PathBuf,
}

impl HostFiles {
    /// Files of the host under a root; `/` is this host.
    pub fn under(root: &Path) -> Self {
        Self { root: root.into() }
    }

    /// Text of a file without surrounding blanks, or the reason why it cannot be read.
    pub fn text(&self, path: &str) -> Result<String, String> {
        match fs::read_to_string(self.root.join(path)) {
            Ok(text) => Ok(text.trim().into()),
            Err(error) if error.kind() == ErrorKind::NotFound => Err(format!("there is no /{path}")),
            Err(error) => Err(format!("/{path}: {error}")),
        }
    }

    /// Number in a file, or the reason why there is none.
    pub fn number(&self, path: &str) -> Result<i64, String> {
        let text = self.text(path)?;
        text.parse().map_err(|_| format!("/{path} is {text:?} and no number"))
    }

    /// Numeric names in a folder: processes, threads, interrupts. Empty if it cannot be read.
    pub fn numbered(&self, folder: &str) -> Vec<u32> {
        let entries = fs::read_dir(self.root.join(folder)).into_iter().flatten().flatten();
        let mut numbers: Vec<_> =
            entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect();
        numbers.sort_unstable();
        numbers
    }

    /// Whether a file or folder exists.
    pub fn exists(&self, path: &str) -> bool {
        self.root.join(path).exists()
    }
}

/// Sample hosts for tests.
#[cfg(test)]
pub mod sample {
    use super::*;

    /// Host made of files in a temporary folder.
    pub struct SampleHost {
        _folder: tempfile::TempDir,
        pub files: HostFiles,
    }

    pub fn host(files: &[(&str, &str)]) -> SampleHost {
        let folder = tempfile::TempDir::new().unwrap();
        for (path, text) in files {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, format!("{text}\n")).unwrap();
        }
        let files = HostFiles::under(folder.path());
        SampleHost { _folder: folder, files }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reason_of_an_unreadable_file_is_returned() {
        let host =
            sample::host(&[("proc/good", " 7"), ("proc/bad", "seven"), ("proc/5/x", ""), ("proc/30/x", "")]);
        assert_eq!(host.files.number("proc/good"), Ok(7));
        assert_eq!(host.files.number("proc/bad"), Err("/proc/bad is \"seven\" and no number".into()));
        assert_eq!(host.files.text("proc/none"), Err("there is no /proc/none".into()));
        assert!(host.files.text("proc/5").unwrap_err().starts_with("/proc/5: "));
        assert_eq!(host.files.numbered("proc"), [5, 30]);
        assert!(host.files.numbered("sys").is_empty());
    }
}
