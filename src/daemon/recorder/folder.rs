//! Folder of recordings with a bound on their size, over all runs.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use tracing::info;

/// Bounds on the sizes of recordings \[bytes\].
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Of one file; it ends up to a second later.
    pub file: u64,
    /// Of all files of a machine in a folder; the oldest are deleted.
    pub total: u64,
}

impl Default for Bounds {
    fn default() -> Self {
        // Four minutes at 1 kHz, an hour in all.
        Self { file: 256 << 20, total: 4 << 30 }
    }
}

/// Folder for the recordings of one run.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    name: String,
    started_s: u64,
    bounds: Bounds,
}

impl Folder {
    /// Of a run that started at a Unix time \[s\].
    pub fn new(path: &Path, name: &str, started_s: u64, bounds: Bounds) -> Self {
        Self { path: path.into(), name: name.into(), started_s, bounds }
    }

    /// Largest size of a file \[bytes\].
    pub fn file_bytes(&self) -> u64 {
        self.bounds.file
    }

    /// Path of a new file, for which there is room within the bound once the oldest are deleted.
    pub fn next_path(&self, part: &str) -> PathBuf {
        // A folder that cannot be read has nothing to delete; the file then says what is wrong.
        let _ = self.make_room();
        self.path.join(format!("{}.{}.{part}.mcap", self.name, self.started_s))
    }

    /// Deletes the oldest recordings of this machine. A name has no dot: no other machine's begins alike.
    fn make_room(&self) -> io::Result<()> {
        let prefix = format!("{}.", self.name);
        let mut files: Vec<(SystemTime, PathBuf, u64)> = vec![];
        for entry in fs::read_dir(&self.path)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with(&prefix) && name.ends_with(".mcap") {
                let metadata = entry.metadata()?;
                files.push((metadata.modified()?, entry.path(), metadata.len()));
            }
        }
        files.sort();
        let mut total: u64 = files.iter().map(|(_, _, bytes)| bytes).sum();
        for (_, path, bytes) in files {
            if total + self.bounds.file <= self.bounds.total {
                break;
            }
            info!("the recordings exceed {} MiB: {} is deleted", self.bounds.total >> 20, path.display());
            fs::remove_file(&path)?;
            total -= bytes;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_recordings_of_the_machine_make_room() {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in [
            ("a.1.1.mcap", 300),
            ("a.1.2.mcap", 300),
            ("a.1.csv", 900),
            ("a-b.1.1.mcap", 900),
            ("a.2.1.mcap", 300),
        ] {
            fs::write(folder.path().join(name), vec![0; bytes]).unwrap();
            std::thread::sleep(core::time::Duration::from_millis(20));
        }
        let bounds = Bounds { file: 200, total: 800 };
        let path = Folder::new(folder.path(), "a", 3, bounds).next_path("001");
        assert_eq!(path, folder.path().join("a.3.001.mcap"));
        let mut left: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|it| it.unwrap().file_name().into_string().unwrap())
            .collect();
        left.sort();
        assert_eq!(left, ["a-b.1.1.mcap", "a.1.2.mcap", "a.1.csv", "a.2.1.mcap"]);
    }
}
