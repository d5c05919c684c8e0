//! Step of the reference that leads to a motion.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;

use crate::control::signals::pair::Pair;
use crate::model::rigid::{Motion, Pose};

/// Step of constant jerk. The stop that is verified begins at its end.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct Step<'a> {
    /// Pose at the start of the step; `None` for the first motion.
    pub from: Option<&'a Pose>,
    /// Duration \[s\].
    pub duration_s: f64,
    /// Bounds on the velocities within the step, besides those at its ends, see [`inner_speeds`].
    pub inner_speeds: Pair<f64>,
    /// Effort that is spent already, in knots of an examination.
    pub effort: u32,
    /// Share of the accelerations with which the stop is planned.
    pub strength_share: f64,
}

impl Default for Step<'_> {
    fn default() -> Self {
        Self { from: None, duration_s: 0.0, inner_speeds: Pair::default(), effort: 0, strength_share: 1.0 }
    }
}

/// Largest norms of `v0 + a0 h / 4` and `v1 - a1 h / 4`, from the motions at both ends of a step and its duration h \[rad/s\],
/// \[m/s\]. The velocity within the step is a quadratic Bezier curve: it stays in the polygon of these two and of the
/// velocities at both ends.
pub(in crate::control::reference) fn inner_speeds(
    begin: &Motion,
    end: &Motion,
    duration_s: f64,
) -> Pair<f64> {
    let quarter = 0.25 * duration_s;
    let largest = |a: Vector3<f64>, b: Vector3<f64>| a.norm_squared().max(b.norm_squared()).sqrt();
    Pair {
        angular: largest(
            begin.twist.angular + begin.acceleration.angular * quarter,
            end.twist.angular - end.acceleration.angular * quarter,
        ),
        linear: largest(
            begin.twist.linear + begin.acceleration.linear * quarter,
            end.twist.linear - end.acceleration.linear * quarter,
        ),
    }
}
