//! Target of the reference in one cycle: where it shall go, and with which share of the limits.

use nalgebra::Vector6;

use crate::control::controller::SetpointKind;
use crate::control::input_validation::SetpointMotion;
use crate::control::limits::Limits;
use crate::control::parameters::Parameters;
use crate::control::reference::pose_samples::PoseSamples;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// Target of one cycle.
#[derive(Clone, Copy, Debug)]
pub enum Target<'a> {
    /// The motion of a setpoint, which goes on between the messages.
    Motion(&'a SetpointMotion),
    /// Samples of a motion.
    Samples(&'a PoseSamples),
    /// A pose to move to and stand at, with the limits of autonomous motions.
    Pose(&'a Pose),
}

impl<'a> Target<'a> {
    /// The target that a valid setpoint stands for.
    pub fn of_setpoint(setpoint: &'a SetpointMotion, samples: &'a PoseSamples) -> Self {
        // No `match`: a jump table inside the cycle is beyond the proof on its machine code.
        if setpoint.setpoint.kind == SetpointKind::Pose {
            Self::Samples(samples)
        } else if setpoint.setpoint.kind == SetpointKind::Target {
            Self::Pose(&setpoint.motion.pose)
        } else {
            Self::Motion(setpoint)
        }
    }

    /// The motion of the target at an instant.
    pub(in crate::control) fn motion_at(&self, parameters: &Parameters, instant_ns: u64) -> Option<Motion> {
        match self {
            Self::Motion(setpoint) => Some(setpoint.motion_at(parameters, instant_ns)),
            Self::Samples(samples) => samples.target(instant_ns),
            Self::Pose(pose) => Some(at_rest(pose)),
        }
    }

    /// The motion at an instant, with the pose as a base pose and the displacement from it: cheaper, and the same to first
    /// order in the displacement.
    pub(super) fn displaced_at(
        &self,
        parameters: &Parameters,
        instant_ns: u64,
    ) -> Option<(Motion, Vector6<f64>)> {
        match self {
            Self::Motion(setpoint) => {
                let continued = setpoint.continued(setpoint.extrapolation_s(parameters, instant_ns));
                let led = Motion {
                    pose: setpoint.motion.pose,
                    twist: Twist::from_vector(&continued.twist),
                    acceleration: Acceleration::from_vector(&continued.acceleration),
                };
                Some((led, continued.displacement))
            }
            Self::Samples(_) | Self::Pose(_) => {
                Some((self.motion_at(parameters, instant_ns)?, Vector6::zeros()))
            }
        }
    }

    /// Share of its limits with which the distance is closed: those of a pose are scaled already.
    pub(super) fn closing_scale(&self, scale: f64) -> f64 {
        if let Self::Pose(_) = self { 1.0 } else { scale }
    }

    /// The limits of the way to it.
    pub(super) fn limits(&self, limits: &Limits) -> Limits {
        match self {
            Self::Motion(_) | Self::Samples(_) => *limits,
            Self::Pose(_) => limits.scaled(limits.autonomous_scale),
        }
    }
}

/// A pose without motion.
pub(super) fn at_rest(pose: &Pose) -> Motion {
    Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() }
}
