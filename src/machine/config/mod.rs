//! Configuration: a TOML file to a validated [`Machine`] and a [`Deployment`].
//!
//! A file describes one machine and, where the defaults do not fit, how it is deployed. It loads only if every key is
//! known, every value is within its bound and the machine can exist. All errors are reported at once, each
//! [`Violation`] with its line, key, value and bound.
//!
//! `config/reference.toml` has every key with its meaning, unit, default and bound.

use std::path::{Path, PathBuf, absolute};
use std::{fmt, io};

use fearless_simd::Level;
use serde::Serialize;
use thiserror::Error;
use toml::de::DeTable;
use tracing::warn;

use hexad_client::messages::{Bus, PortError};
use hexad_core::model::machine::{Machine, at_most_256_bits};

pub use self::bound::number;
use self::deployment::Deployment;
use self::frames::NamedFrame;
use self::reader::{SectionReader, ViolationLog};

mod bound;
pub mod changes;
pub mod control_loops;
pub mod coordinates;
pub mod deployment;
pub mod examination;
pub mod fidelity;
pub mod frames;
mod geometry;
mod machine;
pub mod machine_name;
mod reader;
mod syntax;
pub mod text;

/// Largest number of violations shown of one file; a file with more is no configuration.
const MAX_VIOLATIONS: usize = 100;

/// Largest length of `name`; iceoryx2 allows 255 characters in the name of a service, which contains more than this.
const MAX_NAME_LENGTH: usize = 64;

/// Bounds of the resolution over the stroke: 750 mm are shown in steps of 0.75 um to 7.5 um.
const RESOLUTION_PER_STROKE: [f64; 2] = [1e-6, 1e-5];

/// Validated configuration file.
#[derive(Clone, Debug)]
pub struct Config {
    /// Part of the names of the topics: letters, digits, `_` and `-`.
    pub name: String,
    /// Model of the machine.
    pub machine: Machine,
    /// Named frames, for commands.
    pub frames: Vec<NamedFrame>,
    /// Settings with which the machine is run.
    pub deployment: Deployment,
    /// The file as it was read, for recordings.
    pub text: String,
    /// The file in error texts.
    pub place: String,
    /// The file, wherever the process works; `None` if the text came from elsewhere.
    pub path: Option<PathBuf>,
}

/// Error of loading a configuration.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{place}: could not be read: {cause}")]
    Unreadable {
        /// The file, as it appears in the message.
        place: String,
        /// Error of the operating system.
        cause: io::Error,
    },
    /// The content of the file is invalid; displayed with a line per violation.
    #[error("{}", ViolationList(place, violations))]
    Invalid {
        /// The file, as it appears in the message.
        place: String,
        /// At least one, in the order of the lines.
        violations: Vec<Violation>,
    },
}

/// Violation of a rule of the configuration. Displays as `platform.mass_kg = -3: must be greater than 0`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Violation {
    /// Line, from 1. For a missing key, the line of the section that lacks it.
    pub line: usize,
    /// Full name of the key; legs and components count from 1, as in `leg[3].base_m[1]`.
    pub key: String,
    /// Value as written in the file, or derived from it; `None` where there is none to show.
    pub value: Option<String>,
    /// Bound that the value violates.
    pub bound: String,
}

impl Config {
    /// Reads and validates a file.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let (text, place) = text::read_file(path)?;
        Ok(Self { path: absolute(path).ok(), ..Self::parse(&text, &place)? })
    }

    /// The same once more, by a daemon that runs: of a regular file, which cannot hold it up.
    pub fn load_again(path: &Path) -> Result<Self, ConfigError> {
        let (text, place) = text::read_regular_file(path)?;
        Ok(Self { path: Some(path.into()), ..Self::parse(&text, &place)? })
    }

    /// Validates a text; error texts name it `place`.
    pub fn parse(original: &str, place: &str) -> Result<Self, ConfigError> {
        Self::parse_on(at_most_256_bits(Level::new()), original, place)
    }

    /// The same where the lanes run on an instruction set, with which defaults are computed as well.
    pub fn parse_on(level: Level, original: &str, place: &str) -> Result<Self, ConfigError> {
        let (text, syntax_errors) = syntax::without_broken_lines(original);
        let (table, _) = DeTable::parse_recoverable(&text);
        let log = ViolationLog::new(&text, syntax_errors);
        let mut root = SectionReader::root(&log, table.get_ref());
        let name = root.name("name", MAX_NAME_LENGTH);
        let mut machine = machine::read(&mut root, level);
        let frames = frames::read(&mut root);
        let deployment = deployment::read(&mut root, &machine);
        drop(root);
        if let Some(envelope) = &deployment.envelope {
            machine.max_rotation_rad = machine.max_rotation_rad.max(envelope.largest_rotation(&machine));
        }
        match log.into_violations() {
            violations if violations.is_empty() => {
                let (text, place) = (original.into(), place.into());
                Ok(Self { name, machine, frames, deployment, text, place, path: None })
            }
            violations => Err(ConfigError::Invalid { place: place.into(), violations }),
        }
    }

    /// Smallest length and angle of the machine that are worth showing \[m\], \[rad\]: the noise of a length, within bounds by the
    /// stroke; and the turn that moves a joint of the platform so far.
    pub fn resolution(&self) -> [f64; 2] {
        let [finest, coarsest] = RESOLUTION_PER_STROKE.map(|share| share * self.machine.actuator.stroke());
        let length_m = self.deployment.noise.length_m.clamp(finest, coarsest);
        [length_m, length_m / self.machine.joints.radius_m]
    }

    /// Joins the topics of the machine, in real or simulated time. Logs a warning where time is simulated.
    pub fn join(&self) -> Result<Bus, PortError> {
        if !self.deployment.realtime.is_simulated() {
            return Bus::join(&self.name);
        }
        warn!(
            "TIME IS SIMULATED (realtime.release = \"lockstep\"): no hardware receives messages, topics are \
             hexad-simulated/{}/...",
            self.name
        );
        Bus::join_simulated(&self.name)
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

/// Violations as lines of `place:line: violation`, which editors and terminals turn into links.
struct ViolationList<'a>(&'a str, &'a [Violation]);

impl fmt::Display for ViolationList<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, violation) in self.1.iter().enumerate() {
            let separator = if i == 0 { "" } else { "\n" };
            write!(f, "{separator}{}:{}: {violation}", self.0, violation.line)?;
        }
        Ok(())
    }
}
