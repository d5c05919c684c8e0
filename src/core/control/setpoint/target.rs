//! Target of the reference in one cycle: a motion or a pose, and the share of the limits for the way to it.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;

use crate::control::parameters::Parameters;
use crate::control::setpoint::motion::{RelativeMotion, SetpointMotion};
use crate::control::setpoint::pose_samples::PoseSamples;
use crate::control::signals::inputs::SetpointKind;
use crate::control::signals::limits::Limits;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// Target of one cycle.
#[derive(Clone, Copy, Debug)]
pub enum Target<'a> {
    /// Motion of a setpoint, which continues between the messages.
    Motion(&'a SetpointMotion),
    /// Samples of a motion.
    Samples(&'a PoseSamples),
    /// Pose to move to and stand at, with a share of the limits of autonomous motions.
    Pose {
        /// Goal.
        pose: &'a Pose,
        /// Share of the limits of autonomous motions.
        speed_share: f64,
    },
}

/// Least share of the limits of autonomous motions: with less, the approach loses its numerical precision.
const MIN_TARGET_SPEED: f64 = 0.01;

/// Ratio from which an acceleration is beyond a limit by more than rounding.
pub(in crate::control) const NOTABLE_RATIO: f64 = 1.1;

impl<'a> Target<'a> {
    /// Target that a valid setpoint requests.
    pub fn of_setpoint(setpoint: &'a SetpointMotion, samples: &'a PoseSamples) -> Self {
        // No `match`: the proof on the machine code of the cycle does not cover jump tables.
        if setpoint.setpoint.kind == SetpointKind::Pose {
            Self::Samples(samples)
        } else if setpoint.setpoint.kind == SetpointKind::Target {
            Self::Pose {
                pose: &setpoint.motion.pose,
                speed_share: share(setpoint.setpoint.target_speed_share),
            }
        } else {
            Self::Motion(setpoint)
        }
    }

    /// Motion of the target at an instant.
    pub(in crate::control) fn motion_at(&self, parameters: &Parameters, instant_ns: u64) -> Option<Motion> {
        match self {
            Self::Motion(setpoint) => Some(setpoint.motion_at(parameters, instant_ns)),
            Self::Samples(samples) => samples.target(instant_ns),
            Self::Pose { pose, .. } => Some(at_rest(pose)),
        }
    }

    /// Pose to stand at, if there is one.
    pub(in crate::control) fn pose(&self) -> Option<&'a Pose> {
        if let Self::Pose { pose, .. } = self { Some(pose) } else { None }
    }

    /// Motion at an instant, relative to a pose. The continuation of a setpoint is added to first order in
    /// its displacement.
    pub(in crate::control) fn relative_to(
        &self,
        pose: &Pose,
        parameters: &Parameters,
        instant_ns: u64,
    ) -> Option<RelativeMotion> {
        if let Self::Motion(setpoint) = self {
            let continued = setpoint.continued(setpoint.bounded_extrapolation_s(parameters, instant_ns));
            let displacement = pose.displacement_to(&setpoint.motion.pose).vector() + continued.displacement;
            return Some(RelativeMotion { displacement, ..continued });
        }
        let Motion { pose: desired, twist, acceleration } = self.motion_at(parameters, instant_ns)?;
        Some(RelativeMotion { displacement: pose.displacement_to(&desired).vector(), twist, acceleration })
    }

    /// Share of the target's limits for closing the distance. The limits of a pose are scaled already.
    pub(in crate::control) fn closing_scale(&self, scale: f64) -> f64 {
        if let Self::Pose { .. } = self { 1.0 } else { scale }
    }

    /// Limits for the way to the target, with the share of the accelerations that the drives give. An acceleration
    /// beyond them, such as that of a stop before a bound, ends with the whole jerk: with a share of it the platform
    /// would bounce off the bound.
    pub(in crate::control) fn limits(
        &self,
        limits: &Limits,
        strength_share: f64,
        present: &Acceleration,
    ) -> Limits {
        let strong = limits.scaled_at_equal_stopping_distance(strength_share);
        let Self::Pose { speed_share, .. } = self else { return strong };
        let mut share = limits.scaled(limits.autonomous_scale * speed_share);
        for (share, strong, present) in [
            (&mut share.orientation, &strong.orientation, &present.angular),
            (&mut share.position, &strong.position, &present.linear),
        ] {
            share.velocity *= strength_share.sqrt();
            share.acceleration = share.acceleration.min(strong.acceleration);
            let notable = NOTABLE_RATIO * share.acceleration;
            if present.norm_squared() > notable * notable {
                share.jerk = strong.jerk;
            }
        }
        share
    }
}

/// Share of the limits for the speed of a setpoint; all of them if the speed is no share.
pub fn share(target_speed_share: f64) -> f64 {
    if target_speed_share > 0.0 { target_speed_share.clamp(MIN_TARGET_SPEED, 1.0) } else { 1.0 }
}

/// Motion of a platform that stands at a pose.
pub(in crate::control) fn at_rest(pose: &Pose) -> Motion {
    Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::signals::inputs::Setpoint;
    use crate::control::signals::limits::DerivativeLimits;

    #[test]
    fn the_speed_of_a_target_is_a_share_of_the_limits_of_autonomous_motions() {
        let one = DerivativeLimits { velocity: 1.0, acceleration: 1.0, jerk: 1.0 };
        let limits = Limits { position: one, orientation: one, autonomous_scale: 0.5 };
        for (target_speed_share, share) in
            [(0.0, 1.0), (0.25, 0.25), (1.0, 1.0), (2.0, 1.0), (1e-300, 0.01), (-1.0, 1.0), (f64::NAN, 1.0)]
        {
            for (kind, scale) in [(SetpointKind::Target, 0.5 * share), (SetpointKind::Motion, 1.0)] {
                let setpoint = Setpoint { kind, target_speed_share, ..Setpoint::default() };
                let (setpoint, samples) = (SetpointMotion::new(setpoint), PoseSamples::default());
                let target = Target::of_setpoint(&setpoint, &samples);
                let found = target.limits(&limits, 1.0, &Acceleration::default());
                assert_eq!(
                    [found.position.jerk, found.orientation.velocity],
                    [scale; 2],
                    "{target_speed_share}"
                );
                // With a hundredth of the strength an autonomous motion has the lesser acceleration of both.
                let weak = target.limits(&limits, 0.01, &Acceleration::default());
                assert_eq!(weak.position.acceleration, scale.min(0.01), "{target_speed_share}");
            }
        }
    }
}
