//! Defaults of `[limits]`: motions that a standing person tolerates, or less if the drives cannot give them at home.

use core::fmt;

use serde::Serialize;

use crate::analysis::drive_capability::DriveCapability;
use hexad_core::control::signals::limits::{DerivativeLimits, Limits};
use hexad_core::model::machine::Machine;

/// Motions that a standing person tolerates: half of gravity, built up in a hundredth of a second.
const TOLERATED_POSITION: DerivativeLimits =
    DerivativeLimits { velocity: 1.0, acceleration: 5.0, jerk: 500.0 };
const TOLERATED_ORIENTATION: DerivativeLimits =
    DerivativeLimits { velocity: 2.0, acceleration: 20.0, jerk: 2000.0 };
/// Share of the largest force that holding, friction at the largest rate and both accelerations may use
/// together. The rest is for feedback, and for poses away from home.
const USABLE_FORCE_RATIO: f64 = 0.9;
/// Share of the force left by holding and friction that the linear acceleration may use. The angular
/// acceleration uses the rest.
const LINEAR_SHARE: f64 = 0.5;

/// Defaults of the limits of position and orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DefaultLimits {
    /// Limits of C.
    pub position: DerivativeLimits,
    /// Limits of the rotation.
    pub orientation: DerivativeLimits,
}

impl DefaultLimits {
    /// Defaults for a machine. If its drives cannot hold it at home, the accelerations are the tolerated
    /// ones; the machine is refused anyway.
    pub fn new(machine: &Machine) -> Self {
        let tolerated = Self { position: TOLERATED_POSITION, orientation: TOLERATED_ORIENTATION };
        let Some(drives) = DriveCapability::new(machine, &machine.home_pose()) else { return tolerated };
        let actuator = &machine.actuator;
        let (_, holding) = drives.largest_holding_force();
        let available = actuator.weakest_available_force_n();
        let usable =
            USABLE_FORCE_RATIO * available - actuator.largest_viscous_friction() * actuator.max_rate_m_s;
        // Some acceleration remains even if holding and friction use nearly all force.
        let usable = usable.max(holding + LINEAR_SHARE * (available - holding));
        let for_linear = holding + LINEAR_SHARE * (usable - holding);
        let linear = lesser(TOLERATED_POSITION.acceleration, drives.max_linear_acceleration(for_linear, 0.0));
        let angular = lesser(TOLERATED_ORIENTATION.acceleration, drives.angular_acceleration(usable, linear));
        Self {
            position: scaled(TOLERATED_POSITION, drives.velocity(), linear),
            orientation: scaled(TOLERATED_ORIENTATION, drives.angular_velocity(), angular),
        }
    }
}

/// Default below the tolerated value, because the drives cannot give that.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DerivedLimit {
    /// Key of the limit.
    pub key: &'static str,
    /// The default.
    pub value: f64,
    /// Default of machines whose drives can give it.
    pub usual: f64,
    /// Key from which it follows.
    pub cause: &'static str,
}

impl fmt::Display for DerivedLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, value, usual, cause } = self;
        write!(f, "derived      {key} = {value}, what the drives can give at home ({cause}); usually {usual}")
    }
}

/// The limits in force that are derived from the drives.
pub fn derived_limits(machine: &Machine, limits: &Limits) -> Vec<DerivedLimit> {
    let default = DefaultLimits::new(machine);
    let of = |keys: [&'static str; 3], [value, default, usual]: [&DerivativeLimits; 3]| {
        let values = |limits: &DerivativeLimits| [limits.velocity, limits.acceleration, limits.jerk];
        let causes = ["actuator.max_rate_m_s", "actuator.max_force_n", "actuator.max_force_n"];
        let numbers = values(value).into_iter().zip(values(default)).zip(values(usual));
        let rows = keys.into_iter().zip(causes).zip(numbers);
        let derived = rows.filter(|(_, ((value, default), usual))| value == default && value != usual);
        derived
            .map(|((key, cause), ((value, _), usual))| DerivedLimit { key, value, usual, cause })
            .collect::<Vec<_>>()
    };
    let position = [&limits.position, &default.position, &TOLERATED_POSITION];
    let orientation = [&limits.orientation, &default.orientation, &TOLERATED_ORIENTATION];
    let mut found = of(["limits.velocity_m_s", "limits.acceleration_m_s2", "limits.jerk_m_s3"], position);
    found.extend(of(
        ["limits.velocity_rad_s", "limits.acceleration_rad_s2", "limits.jerk_rad_s3"],
        orientation,
    ));
    found
}

/// Limits with a lesser velocity and acceleration. The acceleration is built up in the same time.
fn scaled(tolerated: DerivativeLimits, velocity: f64, acceleration: f64) -> DerivativeLimits {
    DerivativeLimits {
        velocity: lesser(tolerated.velocity, velocity),
        acceleration,
        jerk: rounded_down(tolerated.jerk / tolerated.acceleration * acceleration),
    }
}

/// The tolerated value, or the possible one rounded down to two digits if that is less.
fn lesser(tolerated: f64, possible: f64) -> f64 {
    if possible > 0.0 && possible < tolerated { rounded_down(possible) } else { tolerated }
}

/// A positive number rounded down to two significant digits, as it would be written.
pub(super) fn rounded_down(x: f64) -> f64 {
    let digit = libm::pow(10.0, libm::log10(x).floor() - 1.0);
    // A number of two digits remains unchanged, however the quotient is rounded.
    let text = format!("{:.1e}", (x / digit * (1.0 + 1e-9)).floor() * digit);
    text.parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_down_to_two_digits() {
        for (x, expected) in [
            (9.48, 9.4),
            (11.86, 11.0),
            (0.02, 0.02),
            (0.0299, 0.029),
            (0.29, 0.29),
            (1.2, 1.2),
            (123.4, 120.0),
        ] {
            assert_eq!(rounded_down(x), expected, "{x}");
        }
    }
}
