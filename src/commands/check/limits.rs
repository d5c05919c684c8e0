//! Limits of all motions, ranges of `[envelope]` below them, which the reference does not keep, and tolerances.

use core::fmt;

use serde::Serialize;

use hexad_core::control::signals::limits::{DerivativeLimits, Limits};
use hexad_machine::analysis::envelope::EnvelopeBounds;
use hexad_machine::config::deployment::{Deployment, DeploymentLimits};
use hexad_machine::text::numbers::{readable, significant};
use hexad_machine::text::units::{ANGLES, LENGTHS, TIMES};

/// Largest velocity, acceleration and jerk of all motions: `[limits]` times `limits.scale`.
#[derive(Clone, Debug, Serialize)]
pub struct MotionLimits {
    /// `limits.scale`.
    pub scale: f64,
    pub velocity_m_s: f64,
    pub acceleration_m_s2: f64,
    pub jerk_m_s3: f64,
    pub velocity_rad_s: f64,
    pub acceleration_rad_s2: f64,
    pub jerk_rad_s3: f64,
}

impl MotionLimits {
    /// Limits of a deployment.
    pub fn new(limits: &DeploymentLimits) -> Self {
        let Limits { position, orientation, .. } = limits.in_force();
        Self {
            scale: limits.scale,
            velocity_m_s: position.velocity,
            acceleration_m_s2: position.acceleration,
            jerk_m_s3: position.jerk,
            velocity_rad_s: orientation.velocity,
            acceleration_rad_s2: orientation.acceleration,
            jerk_rad_s3: orientation.jerk,
        }
    }
}

impl fmt::Display for MotionLimits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let position = [self.velocity_m_s, self.acceleration_m_s2, self.jerk_m_s3].map(significant);
        let orientation = [self.velocity_rad_s, self.acceleration_rad_s2, self.jerk_rad_s3].map(significant);
        let ([v, a, j], [omega, alpha, jerk]) = (position, orientation);
        write!(
            f,
            "motions      at most {v} m/s, {a} m/s^2, {j} m/s^3; {omega} rad/s, {alpha} rad/s^2, {jerk} rad/s^3"
        )?;
        write!(f, " ([limits] times limits.scale = {})", self.scale)
    }
}

/// Tolerances of errors and ages, many of which are defaults by the machine.
#[derive(Clone, Debug, Serialize)]
pub struct Tolerances {
    /// `[in_position]`: how near to a setpoint that does not change the platform has arrived, after the settling time.
    pub in_position_m: f64,
    pub in_position_rad: f64,
    pub settling_s: f64,
    /// `control.engage_*`: how near to the setpoint control begins.
    pub engage_position_m: f64,
    pub engage_orientation_rad: f64,
    /// `control.following_*`: the largest errors under control.
    pub following_position_m: f64,
    pub following_orientation_rad: f64,
    pub following_velocity_m_s: f64,
    pub following_velocity_rad_s: f64,
    /// `[timeouts]`: the largest ages.
    pub setpoint_age_s: f64,
    pub measured_age_s: f64,
}

impl Tolerances {
    /// Tolerances of a deployment.
    pub fn new(deployment: &Deployment) -> Self {
        let Deployment { control, timeouts, in_position, .. } = deployment;
        Self {
            in_position_m: in_position.tolerance_m,
            in_position_rad: in_position.tolerance_rad,
            settling_s: in_position.settling_ns as f64 / 1e9,
            engage_position_m: control.engage_position_m,
            engage_orientation_rad: control.engage_orientation_rad,
            following_position_m: control.following_position_m,
            following_orientation_rad: control.following_orientation_rad,
            following_velocity_m_s: control.following_velocity_m_s,
            following_velocity_rad_s: control.following_velocity_rad_s,
            setpoint_age_s: timeouts.setpoint_s,
            measured_age_s: timeouts.measured_s,
        }
    }
}

impl fmt::Display for Tolerances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [near, engage, following, velocity] = [
            (self.in_position_m, self.in_position_rad),
            (self.engage_position_m, self.engage_orientation_rad),
            (self.following_position_m, self.following_orientation_rad),
            (self.following_velocity_m_s, self.following_velocity_rad_s),
        ]
        .map(|(linear, angular)| [readable(linear, LENGTHS), readable(angular, ANGLES)]);
        let times = [self.settling_s, self.setpoint_age_s, self.measured_age_s];
        let [settling, setpoint, measured] = times.map(|time_s| readable(time_s, TIMES));
        write!(
            f,
            "in position  within {} of a setpoint that does not change, for {settling} ([in_position])\n\
             engage       within {} of the setpoint (control.engage_*)\n\
             following    errors up to {}, {}/s (control.following_*)\n\
             messages     setpoints up to {setpoint} old, measurements up to {measured} ([timeouts])",
            near.join(" and "),
            engage.join(" and "),
            following.join(" and "),
            velocity.join("/s and "),
        )
    }
}

/// Range of `[envelope]` that motions may exceed, because only a limit bounds them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExceedableRange {
    /// Key of the range.
    pub key: &'static str,
    /// Its least value for a position, or for an angle.
    pub least: f64,
    pub unit: &'static str,
    /// Key of the limit.
    pub limit_key: &'static str,
    /// The limit, times `limits.scale`.
    pub limit: f64,
}

impl fmt::Display for ExceedableRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, least, unit, limit_key, limit } = self;
        let [least, limit] = [least, limit].map(|x| significant(*x));
        write!(
            f,
            "requirement  {key} = {least} {unit} does not limit motions, which reach {limit} {unit}; "
        )?;
        write!(f, "for less reduce {limit_key}")
    }
}

/// Ranges of an envelope below the limits of motions.
pub fn exceedable_ranges(envelope: &EnvelopeBounds, limits: &Limits) -> Vec<ExceedableRange> {
    let least = |[a, b, c, x, y, z]: [f64; 6]| [a.min(b).min(c), x.min(y).min(z)];
    let ([turning, moving], [angular, linear]) = (least(envelope.velocity), least(envelope.acceleration));
    let DerivativeLimits { velocity, acceleration, .. } = limits.position;
    let DerivativeLimits { velocity: omega, acceleration: alpha, .. } = limits.orientation;
    let all = [
        ("envelope.velocity", moving, "m/s", "limits.velocity_m_s", velocity),
        ("envelope.velocity", turning, "rad/s", "limits.velocity_rad_s", omega),
        ("envelope.acceleration", linear, "m/s^2", "limits.acceleration_m_s2", acceleration),
        ("envelope.acceleration", angular, "rad/s^2", "limits.acceleration_rad_s2", alpha),
    ]
    .map(|(key, least, unit, limit_key, limit)| ExceedableRange { key, least, unit, limit_key, limit });
    all.into_iter().filter(|range| range.least < range.limit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_machine::config::Config;

    #[test]
    fn tolerances_are_shown_as_they_are_in_force() {
        let telescope = include_str!("../../../tests/data/telescope_m2.toml");
        let stated = "[in_position]\ntolerance_m = 3e-7\ntolerance_rad = 2e-6\nsettling_ms = 250\n";
        let config = Config::parse(&format!("{telescope}\n{stated}"), "a test").unwrap();
        let shown = Tolerances::new(&config.deployment).to_string();
        let words = "in position  within 300 nm and 2.00 urad of a setpoint that does not change, for 250 ms ([in_position])\n\
                     engage       within 2.00 mm and 5.00 mrad of the setpoint (control.engage_*)\n\
                     following    errors up to 20.0 mm and 50.0 mrad, 201 mm/s and 229 mrad/s (control.following_*)\n\
                     messages     setpoints up to 50.0 ms old, measurements up to 20.0 ms ([timeouts])";
        assert_eq!(shown, words);
    }

    #[test]
    fn ranges_below_the_scaled_limits_are_shown_with_the_key_to_change() {
        let envelope = "[envelope]\npose_min = [-0.1, -0.1, -0.1, -0.1, -0.1, -0.1]\n\
                        pose_max = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1]\n\
                        velocity = [0.5, 0.5, 0.5, 0.2, 0.05, 0.2]\nacceleration = [9, 9, 9, 1, 1, 1]\n";
        let shown = |scale: f64| {
            let text = format!(
                "{}[limits]\nvelocity_m_s = 0.3\nvelocity_rad_s = 2\nacceleration_m_s2 = 1.5\n\
                 acceleration_rad_s2 = 8\nscale = {scale}\n{envelope}",
                include_str!("../../../config/fried2008.toml")
            );
            let deployment = Config::parse(&text, "a test").unwrap().deployment;
            let ranges = exceedable_ranges(&deployment.envelope.unwrap(), &deployment.limits.in_force());
            ranges.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(
            shown(1.0),
            [
                "requirement  envelope.velocity = 0.0500 m/s does not limit motions, which reach 0.300 m/s; for less reduce limits.velocity_m_s",
                "requirement  envelope.velocity = 0.500 rad/s does not limit motions, which reach 2.00 rad/s; for less reduce limits.velocity_rad_s",
                "requirement  envelope.acceleration = 1.00 m/s^2 does not limit motions, which reach 1.50 m/s^2; for less reduce limits.acceleration_m_s2",
            ]
        );
        assert_eq!(shown(0.1), [""; 0]);
    }
}
