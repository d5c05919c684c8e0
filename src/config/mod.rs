//! Configuration: a TOML file to a validated [`Machine`] and a [`Deployment`].
//!
//! A file describes one machine and, where the defaults do not fit, how it is deployed. Nothing is taken on trust: a file loads only if every key is
//! known, every value is within its bound and the machine can exist, and everything that is wrong is
//! reported in one go, each [`Violation`] with its line, key, value and bound.
//!
//! `config/reference.toml` has every key with its meaning, unit, default and bound.

use std::{fmt, io, path::Path};

use thiserror::Error;
use toml::de::DeTable;

use crate::model::machine::Machine;

use self::deployment::Deployment;
use self::reader::{Reader, Report};

mod bound;
pub mod control_loops;
pub mod deployment;
pub mod fidelity;
mod geometry;
mod join;
mod machine;
mod reader;
mod syntax;
pub mod text;

/// Violations shown of one file; a file with more is something else.
const MAX_VIOLATIONS: usize = 100;

/// Longest `name`; iceoryx2 allows 255 characters in the name of a service, which adds some of its own.
const LONGEST_NAME: usize = 64;

/// What a configuration file says.
#[derive(Clone, Debug)]
pub struct Config {
    /// Part of the names of the topics: letters, digits, `_` and `-`.
    pub name: String,
    /// What the machine is.
    pub machine: Machine,
    /// How it is run.
    pub deployment: Deployment,
}

/// Why there is no configuration.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file could not be read.
    #[error("{place}: could not be read: {cause}")]
    Unreadable {
        /// The file, as it appears in the message.
        place: String,
        /// What the operating system said.
        cause: io::Error,
    },
    /// The file was read and is wrong; displayed with a line per violation.
    #[error("{}", Listed(place, violations))]
    Invalid {
        /// The file, as it appears in the message.
        place: String,
        /// At least one, in the order of the lines.
        violations: Vec<Violation>,
    },
}

/// One thing that is wrong. Displays as `platform.mass_kg = -3: must be greater than 0`.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// Counts from 1. For a key that is missing, the line of the section it is missing from.
    pub line: usize,
    /// Full name; legs and components count from 1, as in `leg[3].base_m[1]`.
    pub key: String,
    /// As written in the file, or what was derived from it; `None` where there is none to show.
    pub value: Option<String>,
    /// What the value must be.
    pub bound: String,
}

impl Config {
    /// Reads and validates a file.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let (text, place) = text::text_of(path)?;
        Self::parse(&text, &place)
    }

    /// Validates a text; `place` is what messages call it.
    pub fn parse(text: &str, place: &str) -> Result<Self, ConfigError> {
        let (text, syntax_errors) = syntax::readable(text);
        let (table, _) = DeTable::parse_recoverable(&text);
        let report = Report::new(&text, syntax_errors);
        let mut root = Reader::root(&report, table.get_ref());
        let name = root.name("name", LONGEST_NAME);
        let machine = machine::read(&mut root);
        let deployment = deployment::read(&mut root, &machine);
        root.finish();
        match report.into_violations() {
            violations if violations.is_empty() => Ok(Self { name, machine, deployment }),
            violations => Err(ConfigError::Invalid { place: place.into(), violations }),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.value {
            Some(value) => write!(f, "{} = {}: {}", self.key, value, self.bound),
            None => write!(f, "{}: {}", self.key, self.bound),
        }
    }
}

/// `place:line: violation`, a line each: the form editors and terminals turn into links.
struct Listed<'a>(&'a str, &'a [Violation]);

impl fmt::Display for Listed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, violation) in self.1.iter().enumerate() {
            let separator = if i == 0 { "" } else { "\n" };
            write!(f, "{separator}{}:{}: {violation}", self.0, violation.line)?;
        }
        Ok(())
    }
}
