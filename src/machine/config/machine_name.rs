//! Name of a machine: all that a request to its daemon needs of the machine file.

use std::path::Path;

use toml::de::DeTable;

use super::reader::{SectionReader, ViolationLog};
use super::{ConfigError, MAX_NAME_LENGTH, text};

/// Reads the name from a file, also if the rest of the file is not valid: a mistake in it must not keep anybody from stopping.
pub fn name_in(path: &Path) -> Result<String, ConfigError> {
    let (text, place) = text::read_file(path)?;
    let (table, _) = DeTable::parse_recoverable(&text);
    let log = ViolationLog::new(&text, vec![]);
    let mut root = SectionReader::root(&log, table.get_ref());
    let name = root.name("name", MAX_NAME_LENGTH);
    root.ignore_others();
    let violations = log.into_violations();
    if violations.is_empty() { Ok(name) } else { Err(ConfigError::Invalid { place, violations }) }
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
            name_in(&path).map_err(|error| error.to_string())
        };
        assert_eq!(load("name = \"a\"\nmass = -\n[realtime]\nrate_hz = -1"), Ok("a".into()));
        assert_eq!(load("name = \"b\"\n[realtime]\nrelease = \"lockstep\"\n[limits"), Ok("b".into()));
        assert!(load("nam = \"b\"").is_err_and(|error| error.contains("name: ")));
    }
}
