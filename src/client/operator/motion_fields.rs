//! Fields of the requests `goto`, `hold` and `jog`: numbers with their unit in the name.

use serde::{Deserialize, Serialize};

/// Names of the requests that move the platform.
pub const GOTO: &str = "goto";
/// See [`GOTO`].
pub const HOLD: &str = "hold";
/// See [`GOTO`].
pub const JOG: &str = "jog";

/// Coordinates of a target. A missing one stays as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TargetFields {
    /// Angle about x \[rad\].
    pub alpha_rad: Option<f64>,
    /// Angle about y \[rad\].
    pub beta_rad: Option<f64>,
    /// Angle about z \[rad\].
    pub gamma_rad: Option<f64>,
    /// Position along x \[m\].
    pub x_m: Option<f64>,
    /// Position along y \[m\].
    pub y_m: Option<f64>,
    /// Position along z \[m\].
    pub z_m: Option<f64>,
}

impl TargetFields {
    /// Names of the fields, in the order of X.
    pub const NAMES: [&str; 6] = ["alpha_rad", "beta_rad", "gamma_rad", "x_m", "y_m", "z_m"];

    /// Fields of the given coordinates of X.
    pub fn new([alpha_rad, beta_rad, gamma_rad, x_m, y_m, z_m]: [Option<f64>; 6]) -> Self {
        Self { alpha_rad, beta_rad, gamma_rad, x_m, y_m, z_m }
    }

    /// The given coordinates, in the order of X.
    pub fn coordinates(&self) -> [Option<f64>; 6] {
        [self.alpha_rad, self.beta_rad, self.gamma_rad, self.x_m, self.y_m, self.z_m]
    }
}

/// Rates of the coordinates of a jog; 0 where not given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RateFields {
    /// Rate of the angle about x \[rad/s\].
    pub alpha_rad_s: f64,
    /// Rate of the angle about y \[rad/s\].
    pub beta_rad_s: f64,
    /// Rate of the angle about z \[rad/s\].
    pub gamma_rad_s: f64,
    /// Velocity along x \[m/s\].
    pub x_m_s: f64,
    /// Velocity along y \[m/s\].
    pub y_m_s: f64,
    /// Velocity along z \[m/s\].
    pub z_m_s: f64,
}

impl RateFields {
    /// Fields of rates in the order of X.
    pub fn new([alpha_rad_s, beta_rad_s, gamma_rad_s, x_m_s, y_m_s, z_m_s]: [f64; 6]) -> Self {
        Self { alpha_rad_s, beta_rad_s, gamma_rad_s, x_m_s, y_m_s, z_m_s }
    }

    /// The rates, in the order of X.
    pub fn rates(&self) -> [f64; 6] {
        [self.alpha_rad_s, self.beta_rad_s, self.gamma_rad_s, self.x_m_s, self.y_m_s, self.z_m_s]
    }
}

/// A frame: the name of one of the machine file, or its X, as `pose` of `[[frame]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum FrameField {
    /// Name of a frame of the machine file in force.
    Named(String),
    /// X of its axes and origin.
    Pose([f64; 6]),
}
