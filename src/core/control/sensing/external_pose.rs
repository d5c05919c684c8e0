//! Comparison of the measured leg lengths with a pose from another sensor.
//!
//! A wrong homing, a wrong scale or a slipped encoder shifts the pose of forward kinematics. Lengths alone
//! cannot reveal this error. The lengths at the external pose show which leg is wrong.

use serde::{Deserialize, Serialize};

use crate::control::cycle::Cycle;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::inputs::Measurement;
use crate::control::signals::time::seconds_between;
use crate::model::LEGS;
use crate::model::inverse_geometry::leg_lengths;
use crate::model::task::TaskState;

/// Time constant of the filtered differences \[s\]: long enough to average the noise of a tracker; slips and
/// drifts are slower.
const TIME_CONSTANT_S: f64 = 0.03;

/// Filtered differences between the measured lengths and the lengths at the external pose.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct ExternalPose {
    difference: [f64; LEGS],
    time_ns: u64,
}

impl ExternalPose {
    /// Compares lengths and external pose of a measurement that has both. A repeated measurement changes
    /// nothing.
    #[inline(never)]
    pub fn check(&mut self, cycle: &Cycle<'_>, measurement: Option<&Measurement>) -> Result<(), Diagnostic> {
        let Some((measurement, x)) = measurement.and_then(|new| Some((new, new.pose?))) else {
            *self = Self::default();
            return Ok(());
        };
        let constants = cycle.constants;
        let dt = seconds_between(self.time_ns, measurement.time_ns).max(0.0);
        // The first difference is taken unfiltered.
        let share = (dt / TIME_CONSTANT_S).min(1.0);
        self.time_ns = measurement.time_ns;
        let length = leg_lengths(constants.machine(), &TaskState::at_rest(x).motion().pose);
        let bound = constants.parameters.pose_tolerance_m;
        let pairs = self.difference.iter_mut().zip(measurement.length_m.iter().zip(&length));
        let mut largest = (0.0, 0);
        for (leg, (difference, (measured, expected))) in pairs.enumerate() {
            *difference += (measured - expected - *difference) * share;
            // Also true for NaN.
            if !(difference.abs() <= largest.0) {
                largest = (difference.abs(), leg);
            }
        }
        if largest.0 <= bound {
            return Ok(());
        }
        if !largest.0.is_finite() {
            *self = Self::default();
        }
        Err(Diagnostic::new(DiagnosticCode::ExternalPoseMismatch, largest.0, bound).at(largest.1))
    }
}
