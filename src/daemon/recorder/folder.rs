//! Folder of recordings with a bound on their total size, over all runs.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use tracing::info;

/// Bounds on the sizes of recordings \[bytes\].
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Bound on one file. A file ends up to a second later.
    pub file: u64,
    /// Bound on all files of a machine in a folder. The oldest are deleted.
    pub total: u64,
}

impl Default for Bounds {
    fn default() -> Self {
        // Four minutes per file and an hour in total, at 1 kHz.
        Self { file: 256 << 20, total: 4 << 30 }
    }
}

/// Order of recordings, the oldest first.
type Age = (bool, u64, u64);

/// Folder for the recordings of one run.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    name: String,
    started_s: u64,
    bounds: Bounds,
}

impl Folder {
    /// Folder of a run that started at a Unix time \[s\].
    pub fn new(path: &Path, name: &str, started_s: u64, bounds: Bounds) -> Self {
        Self { path: path.into(), name: name.into(), started_s, bounds }
    }

    /// Largest size of a file \[bytes\].
    pub fn file_bytes(&self) -> u64 {
        self.bounds.file
    }

    /// Path of a new file. Deletes the oldest files to make room for it.
    pub fn make_room_for_file(&self, part: &str) -> PathBuf {
        // A folder that cannot be read has no files to delete. Opening the new file then reports the error.
        let _ = self.make_room();
        self.path.join(format!("{}.{}.{part}.mcap", self.name, self.started_s))
    }

    /// Deletes the oldest recordings of this machine. Those of the present run come last, because the clock
    /// may have been set back since the others.
    fn make_room(&self) -> io::Result<()> {
        let mut files: Vec<(Age, PathBuf, u64)> = vec![];
        for entry in fs::read_dir(&self.path)? {
            let entry = entry?;
            if let Some(age) = self.age(&entry.file_name().to_string_lossy()) {
                files.push((age, entry.path(), entry.metadata()?.len()));
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

    /// Age of a recording of this machine, from its name: whether it is of the present run, the start of its
    /// run, the number of its part. `None` for other files. A machine's name has no dot, so no other
    /// machine's files have the same prefix.
    fn age(&self, file: &str) -> Option<Age> {
        let (started_s, part) =
            file.strip_prefix(&self.name)?.strip_prefix('.')?.strip_suffix(".mcap")?.split_once('.')?;
        let started_s = started_s.parse().ok()?;
        let number = part.rsplit('-').next()?.parse().ok()?;
        Some((started_s == self.started_s, started_s, number))
    }
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

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
        let path = Folder::new(folder.path(), "a", 3, bounds).make_room_for_file("001");
        assert_eq!(path, folder.path().join("a.3.001.mcap"));
        let mut left: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|it| it.unwrap().file_name().into_string().unwrap())
            .collect();
        left.sort();
        assert_eq!(left, ["a-b.1.1.mcap", "a.1.2.mcap", "a.1.csv", "a.2.1.mcap"]);
    }

    #[test]
    fn the_present_run_is_the_newest_whatever_the_clock_says() {
        let folder = tempfile::tempdir().unwrap();
        let future = SystemTime::now() + core::time::Duration::from_secs(1_000_000);
        for name in
            ["a.5.998.mcap", "a.5.1000.mcap", "a.9.001.mcap", "a.4.001.mcap", "a.4.002.mcap", "a.x.mcap"]
        {
            let path = folder.path().join(name);
            fs::write(&path, [0; 100]).unwrap();
            if !name.starts_with("a.4.") {
                fs::File::options().write(true).open(&path).unwrap().set_modified(future).unwrap();
            }
        }
        let mut left = vec![];
        for total in [600, 500, 400, 300, 200] {
            Folder::new(folder.path(), "a", 4, Bounds { file: 100, total }).make_room_for_file("003");
            let names = fs::read_dir(folder.path()).unwrap();
            left.push(names.map(|it| it.unwrap().file_name().into_string().unwrap()).collect::<Vec<_>>());
        }
        let gone: Vec<_> = left
            .windows(2)
            .map(|pair| pair[0].iter().find(|name| !pair[1].contains(name)).map(String::as_str))
            .collect();
        let expected = ["a.5.998.mcap", "a.5.1000.mcap", "a.9.001.mcap", "a.4.001.mcap"].map(Some);
        assert_eq!(gone, expected);
    }
}
