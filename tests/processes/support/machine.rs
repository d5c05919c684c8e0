//! A machine file of a test's own, under a name nobody else has.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::{fs, process};

use tempfile::TempDir;

use super::children::{Ended, Hexad};

const FRIED: &str = include_str!("../../../config/fried2008.toml");

/// Period of every machine file made here: the default 1 kHz.
pub const PERIOD_NS: u64 = 1_000_000;

/// All timeouts of [`PATIENT`].
pub const TIMEOUT_NS: u64 = 400_000_000;

/// Timeouts that stalls of the host do not reach: of 200 ms some were seen.
pub const PATIENT: &str = "
[timeouts]
setpoint_ms = 400.0
measured_ms = 400.0
allow_unstable_age = true

[plant]
force_timeout_ms = 400.0
";

/// A machine file whose timeouts are those of [`PATIENT`]: for tests beside others, of what is no timeout.
pub fn patient(file: &str) -> String {
    let mut sections: toml::Table = file.parse().expect("a machine file");
    for (name, keys) in PATIENT.parse::<toml::Table>().expect("sections") {
        let section = sections.entry(name).or_insert_with(|| toml::Table::new().into());
        section.as_table_mut().expect("a section").extend(keys.as_table().expect("a section").clone());
    }
    sections.to_string()
}

/// A machine file in a folder that goes away with it.
pub struct Machine {
    folder: TempDir,
    pub name: String,
    pub file: PathBuf,
}

impl Machine {
    /// The machine of the paper with more sections.
    pub fn with(test: &str, sections: &str) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("{test}-{}-{}", process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let folder = TempDir::new().expect("a temporary folder");
        let file = folder.path().join("machine.toml");
        let text = FRIED.replace("name = \"fried2008\"", &format!("name = \"{name}\""));
        assert!(text.contains(&name), "the name must have been replaced");
        fs::write(&file, format!("{text}\n{sections}")).expect("a machine file");
        Self { folder, name, file }
    }

    /// The machine of the paper with [`PATIENT`].
    pub fn patient(test: &str) -> Self {
        Self::with(test, PATIENT)
    }

    /// `hexad COMMAND --config <this file> <more>` to its end.
    pub fn hexad<S: AsRef<OsStr>>(&self, command: &str, more: &[S]) -> Ended {
        Hexad::start(self, command, more).ends()
    }

    /// A file beside the machine file.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The folder of all its files.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
}
