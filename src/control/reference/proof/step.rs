//! The step that leads to a motion.

use crate::control::signals::pair::Pair;
use crate::model::rigid::Pose;

/// The step of constant jerk that leads to the motion from which a stop is verified.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control::reference) struct Step<'a> {
    /// The pose from which it leads; `None` if the motion is the first.
    pub from: Option<&'a Pose>,
    /// \[s\]
    pub duration: f64,
    /// Norms of the change of the acceleration \[rad/s^2\], \[m/s^2\].
    pub acceleration_change: Pair<f64>,
    /// Work that it took to propose it, in knots of an examination.
    pub effort: u32,
}

impl Step<'_> {
    /// Largest velocities within the step beyond those at its ends.
    pub fn velocity_overshoot(&self) -> Pair<f64> {
        self.acceleration_change.map(|change| change * self.duration / 8.0)
    }
}
