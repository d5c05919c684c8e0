//! What the commands take, and what it means.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

use super::r#move::{Score, SetpointError};
use super::workspace::Wish;
use super::workspace::slice::Plane;
use super::{export, offline};
use crate::config::{Config, ConfigError};
use crate::model::fidelity::Fidelity;
use crate::motion::built_in::BuiltInMotion;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};

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

#[derive(Debug, Args)]
pub struct WishArguments {
    /// Two of alpha, beta, gamma, x, y, z, as in x-z; may be given more than once [default: horizontal, vertical, tilt]
    #[arg(long = "plane", value_name = "PLANE")]
    planes: Vec<Plane>,
    /// The pose all slices go through, alpha,beta,gamma,x,y,z [rad, m] [default: home]
    #[arg(long, value_name = "POSE", value_parser = pose, allow_hyphen_values = true)]
    through: Option<[f64; 6]>,
    /// Poses along each axis of a slice
    #[arg(long, value_name = "POSES", default_value_t = 121, value_parser = resolution, allow_negative_numbers = true)]
    resolution: usize,
    /// Acceleration for the forces, in any direction [default: that of [limits]]
    #[arg(long, value_name = "A", value_parser = acceleration, allow_negative_numbers = true)]
    acceleration_m_s2: Option<f64>,
    /// Angular acceleration for the forces, about any axis [default: that of [limits]]
    #[arg(long, value_name = "A", value_parser = acceleration, allow_negative_numbers = true)]
    angular_acceleration_rad_s2: Option<f64>,
    /// Turn about any axis that the second ball allows [deg]
    #[arg(long, value_name = "DEG", default_value_t = 10.0, value_parser = turn, allow_negative_numbers = true)]
    turn_deg: f64,
    /// Folder for the maps and their tables
    #[arg(long, value_name = "FOLDER", default_value = "hexad-workspace")]
    output: PathBuf,
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
            (Some(path), _) => Score::trajectory(config, path),
            (None, name) => {
                let motion = match name.unwrap_or(MotionName::Settle) {
                    MotionName::Settle => BuiltInMotion::Settle,
                    MotionName::MinimumJerk => BuiltInMotion::MinimumJerk,
                    MotionName::Sines => BuiltInMotion::Sines,
                    MotionName::Circle => BuiltInMotion::Circle,
                    MotionName::Paper => BuiltInMotion::Paper,
                };
                Score::motion(config, motion, seconds)
            }
        }
    }
}

impl From<WishArguments> for Wish {
    fn from(wish: WishArguments) -> Self {
        Self {
            planes: wish.planes,
            through: wish.through,
            resolution: wish.resolution,
            acceleration_m_s2: wish.acceleration_m_s2,
            angular_acceleration_rad_s2: wish.angular_acceleration_rad_s2,
            turn_deg: wish.turn_deg,
            output: wish.output,
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
pub fn fidelities() -> impl TypedValueParser<Value = Fidelity> {
    PossibleValuesParser::new(Fidelity::ALL.map(Fidelity::name)).map(|name| {
        Fidelity::ALL.into_iter().find(|fidelity| fidelity.name() == name).unwrap_or(Fidelity::Exact)
    })
}

/// A length of time \[s\].
pub fn duration(text: &str) -> Result<f64, String> {
    within(text, 0.1..=86400.0, " s")
}

/// \[m/s^2\] or \[rad/s^2\]
fn acceleration(text: &str) -> Result<f64, String> {
    within(text, 0.0..=1e6, "")
}

/// Of a platform that is still the right way up \[deg\].
fn turn(text: &str) -> Result<f64, String> {
    within(text, 0.0..=90.0, " deg")
}

/// Poses along an axis: enough for a picture, few enough for memory.
fn resolution(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count) if (11..=1001).contains(&count) => Ok(count),
        _ => Err("must be an integer in [11, 1001]".into()),
    }
}

fn within(text: &str, bounds: RangeInclusive<f64>, unit: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if bounds.contains(&number) => Ok(number),
        Ok(_) => Err(format!("must be in [{}, {}]{unit}", bounds.start(), bounds.end())),
        Err(_) => Err("must be a number".into()),
    }
}

/// X.
fn pose(text: &str) -> Result<[f64; 6], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let six = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    let bounded = |x: &[f64; 6]| x.iter().all(|x| x.abs() <= 1e12);
    six.filter(bounded)
        .ok_or_else(|| "must be six numbers, as in 0,0,0,0,0,1.25, at most 1e12 in magnitude".into())
}
