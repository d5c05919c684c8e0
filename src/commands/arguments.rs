//! Arguments that several commands share, and their value parsers.

use core::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::quantity::angle_within;
use crate::commands::orientation::{OrientationFormat, ROTATION_HELP};
use hexad_client::operator::protocol::RequestLine;
use hexad_core::motion::built_in::BuiltInMotion;
use hexad_machine::config::{Config, ConfigError};
use hexad_machine::text::csv_table::GROUPS;

/// Help text of `--group`.
pub const GROUP_HELP: &str =
    "Group of columns to read from a table of hexad convert; else setpoint, or the only one";

/// Help text of `--gravity-cone`.
pub const CONE_HELP: &str = "Gravity in any direction up to this angle from the file's, with its unit: a base that tips or is mounted otherwise";

/// Half angle of a cone of directions \[rad\].
pub fn cone(text: &str) -> Result<f64, String> {
    angle_within(text, ["0deg", "180deg"])
}

/// Configuration of demonstrations and diagnoses without `--config`.
pub const DEFAULT_CONFIG: &str = include_str!("../../config/fried2008.toml");

/// File name of [`DEFAULT_CONFIG`] in error texts.
pub const DEFAULT_CONFIG_NAME: &str = "fried2008.toml";

// Doc comments of fields are the help texts.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub struct MachineFile {
    /// Machine file (TOML)
    #[arg(value_name = "MACHINE")]
    argument: Option<PathBuf>,
    /// The same as an option
    #[arg(long = "config", value_name = "FILE")]
    option: Option<PathBuf>,
}

impl MachineFile {
    pub fn load(&self) -> Result<Config, ConfigError> {
        Config::load(self.path())
    }

    pub fn path(&self) -> &Path {
        // One of them is there: the group is required.
        self.argument.as_deref().or(self.option.as_deref()).unwrap_or(Path::new(""))
    }
}

/// Machine file of commands that do without.
#[derive(Debug, Args)]
#[group(multiple = false)]
pub struct OptionalMachineFile {
    /// Machine file (TOML); without it, the built-in fried2008, or what runs on this host; requests also take the name of a machine that runs
    #[arg(value_name = "MACHINE")]
    argument: Option<PathBuf>,
    /// The same as an option
    #[arg(long = "config", value_name = "FILE")]
    option: Option<PathBuf>,
}

impl OptionalMachineFile {
    pub fn path(&self) -> Option<&Path> {
        self.argument.as_deref().or(self.option.as_deref())
    }
}

#[derive(Clone, Copy, Debug, Args)]
pub struct EngageOptions {
    /// Take control, if the platform is not under control
    #[arg(long)]
    engage: bool,
    /// Longest to wait for control [s]
    #[arg(long, default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true, requires = "engage")]
    within: f64,
}

impl EngageOptions {
    /// A request of a motion with these options.
    pub fn line(self, request: &str) -> RequestLine {
        RequestLine { engage: self.engage, within_s: self.within, ..RequestLine::new(request) }
    }
}

#[derive(Debug, Args)]
pub struct TableFiles {
    /// CSV to read; `-` is standard input
    ///
    /// Motions have the columns of `hexad move --trajectory`; lengths t, length_1 ... length_6 and length_rate_1 ... length_rate_6 or none
    /// of these, in s and m, or with a unit at the end of the name: length_1_mm, length_rate_1_mm_s.
    #[arg(long, value_name = "FILE")]
    pub input: PathBuf,
    /// CSV to write; `-` is standard output
    #[arg(long, value_name = "FILE")]
    pub output: PathBuf,
    #[arg(long, help = ROTATION_HELP, value_name = "ORDER", default_value = "xyz", value_parser = OrientationFormat::by_name())]
    pub rotation: OrientationFormat,
    #[arg(long, help = GROUP_HELP, value_name = "GROUP", value_parser = PossibleValuesParser::new(GROUPS))]
    pub group: Option<String>,
}

/// Parser of the names of built-in motions.
pub fn built_in_motion() -> impl TypedValueParser<Value = BuiltInMotion> {
    let value = |motion: BuiltInMotion| PossibleValue::new(motion.name()).help(motion.description());
    PossibleValuesParser::new(BuiltInMotion::ALL.map(value))
        .map(|name| BuiltInMotion::by_name(&name).unwrap_or(BuiltInMotion::Settle))
}

/// Duration \[s\] of a motion, a wait or a measurement.
pub fn duration(text: &str) -> Result<f64, String> {
    number_within(text, 0.1..=86400.0, " s")
}

/// Number within bounds that the error text names.
pub fn number_within(text: &str, bounds: RangeInclusive<f64>, unit: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if bounds.contains(&number) => Ok(number),
        Ok(_) => Err(format!("must be in [{}, {}]{unit}", bounds.start(), bounds.end())),
        Err(_) => Err("must be a number".into()),
    }
}
