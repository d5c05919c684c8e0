//! What the commands take, and what it means.

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use hexad::host::config::{Config, ConfigError};
use hexad::host::export;
use hexad::host::offline;
use hexad::host::setpoints::{Score, SetpointError};
use hexad::model::ladder::Rung;
use hexad::scene::motions::Motion;

#[derive(Debug, Args)]
pub struct MachineFile {
    /// Machine file (TOML)
    #[arg(long = "config", value_name = "FILE")]
    pub path: PathBuf,
}

#[derive(Debug, Args)]
pub struct Files {
    /// CSV to read
    #[arg(long, value_name = "FILE")]
    pub input: PathBuf,
    /// CSV to write
    #[arg(long, value_name = "FILE")]
    pub output: PathBuf,
}

#[derive(Debug, Args)]
pub struct Patience {
    /// Longest to wait for the outcome [s]
    #[arg(long, default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true)]
    pub within: f64,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub struct What {
    /// A built-in motion
    #[arg(long, value_enum)]
    pub motion: Option<MotionName>,
    /// A CSV file with t, X, X', X''
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum MotionName {
    /// Stand at home
    Settle,
    /// Moves along every axis in turn, there and back
    MinimumJerk,
    /// A sine on every axis
    Sines,
    /// A circle at constant orientation
    Circle,
    /// A spatial curve at the constant orientation 15, 10, 5 degrees
    Paper,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Start {
    /// At the row before, the first at home
    Previous,
    /// At home
    Home,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum FormatName {
    /// A model for MuJoCo, its loops closed
    Mjcf,
    /// URDF, its loops open at the platform
    Urdf,
}

impl MachineFile {
    pub fn load(&self) -> Result<Config, ConfigError> {
        Config::load(&self.path)
    }
}

impl Patience {
    pub fn longest(&self) -> Duration {
        Duration::from_secs_f64(self.within)
    }
}

impl What {
    pub fn score(&self, config: &Config, seconds: f64) -> Result<Score, SetpointError> {
        match (&self.trajectory, self.motion) {
            (Some(path), _) => Score::trajectory(path),
            (None, name) => {
                let motion = match name.unwrap_or(MotionName::Settle) {
                    MotionName::Settle => Motion::Settle,
                    MotionName::MinimumJerk => Motion::MinimumJerk,
                    MotionName::Sines => Motion::Sines,
                    MotionName::Circle => Motion::Circle,
                    MotionName::Paper => Motion::Paper,
                };
                Ok(Score::motion(&config.machine, motion, seconds))
            }
        }
    }
}

impl From<Start> for offline::Start {
    fn from(start: Start) -> Self {
        match start {
            Start::Previous => Self::Previous,
            Start::Home => Self::Home,
        }
    }
}

impl From<FormatName> for export::Format {
    fn from(format: FormatName) -> Self {
        match format {
            FormatName::Mjcf => Self::Mjcf,
            FormatName::Urdf => Self::Urdf,
        }
    }
}

/// The ladder of models by name.
pub fn rungs() -> impl TypedValueParser<Value = Rung> {
    PossibleValuesParser::new(Rung::ALL.map(Rung::name))
        .map(|name| Rung::ALL.into_iter().find(|rung| rung.name() == name).unwrap_or(Rung::Exact))
}

/// A length of time \[s\].
pub fn duration(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.1..=86400.0).contains(&seconds) => Ok(seconds),
        Ok(_) => Err("must be in [0.1, 86400] s".into()),
        Err(_) => Err("must be a number".into()),
    }
}
