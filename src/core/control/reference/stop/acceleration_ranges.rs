//! Accelerations that a stop takes, as ranges along two directions: the drives must be able to give every sum.

use core::f64::consts::FRAC_1_SQRT_2;

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;

use crate::control::reference::stop::pose_stop::StopKind;
use crate::control::reference::stop::vector_stop::braking_direction;
use crate::control::signals::limits::{DerivativeLimits, Limits};
use crate::control::signals::pair::Pair;
use crate::model::rigid::Motion;

/// Factor of `a_p^2` in the square of the peak of a stop that brakes at once: `1 / 1.2 + 1/2`, rounded up.
const PEAK_PER_START: f64 = 1.34;

/// Accelerations between two multiples of a direction.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control::reference) struct AccelerationRange {
    pub direction: Vector3<f64>,
    pub lowest: f64,
    pub highest: f64,
}

/// Accelerations of a stop of a vector.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control::reference) struct AccelerationRanges {
    pub ranges: [AccelerationRange; 2],
    /// Bound on the magnitude.
    pub largest: f64,
}

impl AccelerationRanges {
    /// Accelerations of the stop of a kind from a motion.
    pub fn of_stop(kind: StopKind, motion: &Motion, limits: &Limits) -> Pair<Self> {
        let Motion { twist, acceleration, .. } = motion;
        let of_vector = match kind {
            StopKind::ReleaseFirst => Self::release_first,
            StopKind::BrakeAtOnce => Self::brake_at_once,
        };
        Pair {
            angular: of_vector(&twist.angular, &acceleration.angular, &limits.orientation),
            linear: of_vector(&twist.linear, &acceleration.linear, &limits.position),
        }
    }

    /// From a to zero, then against v1. The stop from v1 reaches the acceleration `sqrt(J v1)`, at most A.
    fn release_first(v: &Vector3<f64>, a: &Vector3<f64>, limits: &DerivativeLimits) -> Self {
        let magnitude = a.norm();
        let v1 = v + a * (0.5 * magnitude / limits.jerk);
        let speed = v1.norm();
        let peak = limits.acceleration.min((limits.jerk * speed).sqrt());
        let lowest = if speed > 0.0 { -peak / speed } else { 0.0 };
        Self {
            ranges: [
                AccelerationRange { direction: *a, lowest: 0.0, highest: 1.0 },
                AccelerationRange { direction: v1, lowest, highest: 0.0 },
            ],
            largest: magnitude.max(peak),
        }
    }

    /// Along u from the present acceleration to the peak of braking; across from c to `-c / sqrt 2`. With a
    /// jerk of at least 0.6 J the speed grows to at most `v_p + a_p^2 / 1.2 J`, from which the square of the
    /// peak is at most `J v + a_p^2 / 2`.
    fn brake_at_once(v: &Vector3<f64>, a: &Vector3<f64>, limits: &DerivativeLimits) -> Self {
        let u = braking_direction(v, a, limits);
        let (speed, along) = (v.dot(&u), a.dot(&u));
        let rest = a - u * along;
        let square = limits.jerk * speed.abs() + PEAK_PER_START * along * along;
        let peak = limits.acceleration.min(square.sqrt());
        let moves_on = speed + 0.5 * along * along.abs() / limits.jerk >= 0.0;
        let (lowest, highest) = if moves_on { (-peak, along.max(0.0)) } else { (along.min(0.0), peak) };
        Self {
            ranges: [
                AccelerationRange { direction: u, lowest, highest },
                AccelerationRange { direction: rest, lowest: -FRAC_1_SQRT_2, highest: 1.0 },
            ],
            largest: limits.acceleration,
        }
    }
}
