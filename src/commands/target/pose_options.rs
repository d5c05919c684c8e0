//! Options of a command for a pose, in SI units or in millimetres and degrees.

use clap::Args;

use crate::commands::arguments::number_within;

/// Largest number of an option, in any unit: larger than any machine.
const LARGEST: f64 = 1e6;

#[derive(Clone, Copy, Debug, Default, Args)]
#[command(next_help_heading = "Target, X of the platform or of --tool; what is not given stays as it is")]
pub struct PoseOptions {
    /// x [m]
    #[arg(long, value_name = "M", value_parser = number, allow_negative_numbers = true, conflicts_with = "x_mm")]
    x: Option<f64>,
    /// x [mm]
    #[arg(long, value_name = "MM", value_parser = number, allow_negative_numbers = true)]
    x_mm: Option<f64>,
    /// y [m]
    #[arg(long, value_name = "M", value_parser = number, allow_negative_numbers = true, conflicts_with = "y_mm")]
    y: Option<f64>,
    /// y [mm]
    #[arg(long, value_name = "MM", value_parser = number, allow_negative_numbers = true)]
    y_mm: Option<f64>,
    /// z [m]
    #[arg(long, value_name = "M", value_parser = number, allow_negative_numbers = true, conflicts_with = "z_mm")]
    z: Option<f64>,
    /// z [mm]
    #[arg(long, value_name = "MM", value_parser = number, allow_negative_numbers = true)]
    z_mm: Option<f64>,
    /// Bryan angle alpha, about x [rad]
    #[arg(long, value_name = "RAD", value_parser = number, allow_negative_numbers = true, conflicts_with = "alpha_deg")]
    alpha: Option<f64>,
    /// Bryan angle alpha, about x [deg]
    #[arg(long, value_name = "DEG", value_parser = number, allow_negative_numbers = true)]
    alpha_deg: Option<f64>,
    /// Bryan angle beta, about y [rad]
    #[arg(long, value_name = "RAD", value_parser = number, allow_negative_numbers = true, conflicts_with = "beta_deg")]
    beta: Option<f64>,
    /// Bryan angle beta, about y [deg]
    #[arg(long, value_name = "DEG", value_parser = number, allow_negative_numbers = true)]
    beta_deg: Option<f64>,
    /// Bryan angle gamma, about z [rad]
    #[arg(long, value_name = "RAD", value_parser = number, allow_negative_numbers = true, conflicts_with = "gamma_deg")]
    gamma: Option<f64>,
    /// Bryan angle gamma, about z [deg]
    #[arg(long, value_name = "DEG", value_parser = number, allow_negative_numbers = true)]
    gamma_deg: Option<f64>,
}

impl PoseOptions {
    /// Given values of alpha, beta, gamma, x, y, z \[rad\], \[m\].
    pub fn coordinates(&self) -> [Option<f64>; 6] {
        let angle = |rad: Option<f64>, deg: Option<f64>| rad.or(deg.map(f64::to_radians));
        let length = |m: Option<f64>, mm: Option<f64>| m.or(mm.map(|mm| mm * 1e-3));
        [
            angle(self.alpha, self.alpha_deg),
            angle(self.beta, self.beta_deg),
            angle(self.gamma, self.gamma_deg),
            length(self.x, self.x_mm),
            length(self.y, self.y_mm),
            length(self.z, self.z_mm),
        ]
    }

    /// The pose of the options: each coordinate as given, or added to that of `base`.
    pub fn applied_to(&self, base: [f64; 6], is_relative: bool) -> [f64; 6] {
        let mut x = base;
        for (x, given) in x.iter_mut().zip(self.coordinates()) {
            *x = given.map_or(*x, |given| if is_relative { *x + given } else { given });
        }
        x
    }

    /// Whether no option is given.
    pub fn is_empty(&self) -> bool {
        self.coordinates().iter().all(Option::is_none)
    }
}

fn number(text: &str) -> Result<f64, String> {
    number_within(text, -LARGEST..=LARGEST, "")
}
