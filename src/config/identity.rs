//! Identity of a machine: what a request to its daemon needs of the machine file.

use std::path::Path;

use toml::de::DeTable;
use tracing::warn;

use super::reader::{SectionReader, ViolationLog};
use super::{ConfigError, MAX_NAME_LENGTH, text};
use crate::messages::{Bus, PortError};

/// Name of a machine, and whether its time is simulated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Part of the names of the topics.
    pub name: String,
    /// Whether `realtime.release` is `"lockstep"`.
    pub is_simulated: bool,
}

impl Identity {
    /// Reads it from a file, also if the rest of the file is not valid: a mistake in it must not keep anybody from stopping.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let (text, place) = text::read_file(path)?;
        let (table, _) = DeTable::parse_recoverable(&text);
        let log = ViolationLog::new(&text, vec![]);
        let name = SectionReader::root(&log, table.get_ref()).name("name", MAX_NAME_LENGTH);
        let violations = log.into_violations();
        if !violations.is_empty() {
            return Err(ConfigError::Invalid { place, violations });
        }
        let ignored = ViolationLog::new(&text, vec![]);
        let mut realtime = SectionReader::root(&ignored, table.get_ref()).section("realtime");
        Ok(Self { name, is_simulated: realtime.choice_or("release", false, &[("lockstep", true)]) })
    }

    /// Joins the topics of the machine. Logs a warning where time is simulated.
    pub fn join(&self) -> Result<Bus, PortError> {
        if self.is_simulated {
            warn!(
                "TIME IS SIMULATED (realtime.release = \"lockstep\"): no hardware receives messages, topics are \
                 hexad-simulated/{}/...",
                self.name
            );
            return Bus::join_simulated(&self.name);
        }
        Bus::join(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_found_in_a_file_with_mistakes_and_not_without_a_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.toml");
        let load = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Identity::load(&path)
                .map(|found| (found.name, found.is_simulated))
                .map_err(|error| error.to_string())
        };
        assert_eq!(load("name = \"a\"\nmass = -\n[realtime]\nrate_hz = -1"), Ok(("a".into(), false)));
        assert_eq!(load("name = \"b\"\n[realtime]\nrelease = \"lockstep\"\n[limits"), Ok(("b".into(), true)));
        assert!(load("nam = \"b\"").is_err_and(|error| error.contains("name: ")));
    }
}
