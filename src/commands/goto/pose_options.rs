//! Options of a command for a pose, each value with its unit.

use clap::Args;

use crate::commands::quantity::{angle, length};

#[derive(Clone, Copy, Debug, Default, Args)]
#[command(next_help_heading = "Target, X of the platform or of --tool; what is not given stays as it is")]
pub struct PoseOptions {
    /// x, with its unit: m, mm, um, nm
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    x: Option<f64>,
    /// y
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    y: Option<f64>,
    /// z
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    z: Option<f64>,
    /// Bryan angle alpha, about x, with its unit: rad, mrad, urad, deg, arcmin, arcsec
    #[arg(long, value_name = "ANGLE", value_parser = angle, allow_hyphen_values = true)]
    alpha: Option<f64>,
    /// Bryan angle beta, about y
    #[arg(long, value_name = "ANGLE", value_parser = angle, allow_hyphen_values = true)]
    beta: Option<f64>,
    /// Bryan angle gamma, about z
    #[arg(long, value_name = "ANGLE", value_parser = angle, allow_hyphen_values = true)]
    gamma: Option<f64>,
}

impl PoseOptions {
    /// Given values of alpha, beta, gamma, x, y, z \[rad\], \[m\].
    pub fn coordinates(&self) -> [Option<f64>; 6] {
        [self.alpha, self.beta, self.gamma, self.x, self.y, self.z]
    }

    /// Whether no option is given.
    pub fn is_empty(&self) -> bool {
        self.coordinates().iter().all(Option::is_none)
    }
}
