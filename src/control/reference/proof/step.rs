//! Step of the reference that leads to a motion.

use crate::control::signals::pair::Pair;
use crate::model::rigid::Pose;

/// Step of constant jerk. The stop that is verified begins at its end.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct Step<'a> {
    /// Pose at the start of the step; `None` for the first motion.
    pub from: Option<&'a Pose>,
    /// Duration \[s\].
    pub duration: f64,
    /// Norms of the change of acceleration over the step \[rad/s^2\], \[m/s^2\].
    pub acceleration_change: Pair<f64>,
    /// Effort that is spent already, in knots of an examination.
    pub effort: u32,
    /// Share of the accelerations with which the stop is planned.
    pub strength: f64,
}

impl Default for Step<'_> {
    fn default() -> Self {
        Self { from: None, duration: 0.0, acceleration_change: Pair::default(), effort: 0, strength: 1.0 }
    }
}

impl Step<'_> {
    /// Bounds on how far the velocities within the step exceed the velocities at its ends.
    pub fn velocity_excess_over_ends(&self) -> Pair<f64> {
        self.acceleration_change.map(|change| change * self.duration / 8.0)
    }
}
