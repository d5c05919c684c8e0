//! Bound on the total commanded acceleration: reference plus feedback.
//!
//! ```text
//! computed torque:  |a_d + s a| <= (1 + feedback_scale) A      position, orientation; largest s in [0, 1]
//! modes on legs:    |s a_i| <= (1 + feedback_scale) (A + r Ar) + largest disturbance of leg i
//! ```
//!
//! The feedback acceleration keeps its direction. The bound limits how fast a failed sensor, a collision or a
//! wrong payload can accelerate the platform. Saturation that lasts is a fault.

use nalgebra::{Vector3, Vector6};

use serde::{Deserialize, Serialize};

use crate::control::cycle::Cycle;
use crate::control::parameters::Parameters;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::errors::CommandedAcceleration;
use crate::model::rigid::Acceleration;

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;

/// Longest permitted saturation of feedback \[s\]: longer than a brief impact or a step at the start of
/// control.
const MAX_SATURATION_S: f64 = 0.1;

/// Rate at which saturation time is forgotten, relative to the rate at which it counts. Feedback that
/// oscillates between its bounds, for example because a sensor is frozen, is saturated at least a twentieth
/// of the time.
const FORGETTING_RATIO: f64 = 0.03;

/// Bound on feedback, with the recent time in saturation.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct FeedbackLimiter {
    saturated_s: f64,
}

impl FeedbackLimiter {
    /// Checks the time in saturation that is not yet forgotten against its bound.
    pub fn check_saturation_time(&self) -> Result<(), Diagnostic> {
        if self.saturated_s <= MAX_SATURATION_S {
            return Ok(());
        }
        Err(Diagnostic::new(DiagnosticCode::FeedbackSaturated, self.saturated_s, MAX_SATURATION_S))
    }

    /// Limits the feedback acceleration that is added to the reference acceleration.
    pub fn limit(
        &mut self,
        cycle: &Cycle<'_>,
        desired: &Acceleration,
        CommandedAcceleration(wanted): &CommandedAcceleration,
    ) -> CommandedAcceleration {
        let parameters = &cycle.constants.parameters;
        let limited = match parameters.law.mode.acts_on_legs() {
            true => scale_leg_accelerations(cycle, wanted),
            false => scale_platform_acceleration(parameters, desired, wanted),
        };
        let rate = if limited != *wanted { 1.0 } else { -FORGETTING_RATIO };
        self.saturated_s = (self.saturated_s + rate * parameters.period_s()).max(0.0);
        CommandedAcceleration(limited)
    }
}

fn scale_platform_acceleration(
    parameters: &Parameters,
    desired: &Acceleration,
    wanted: &Vector6<f64>,
) -> Vector6<f64> {
    let Parameters { limits, feedback_scale, .. } = parameters;
    let added = Acceleration::from_vector(wanted);
    let bounded = |desired: &Vector3<f64>, added: &Vector3<f64>, limit: f64| {
        added * share_within(desired, added, (1.0 + feedback_scale) * limit)
    };
    Acceleration {
        angular: bounded(&desired.angular, &added.angular, limits.orientation.acceleration),
        linear: bounded(&desired.linear, &added.linear, limits.position.acceleration),
    }
    .vector()
}

/// Largest share s in \[0, 1\] with `|desired + s added| <= bound`, provided that `|desired| <= bound`.
fn share_within(desired: &Vector3<f64>, added: &Vector3<f64>, bound: f64) -> f64 {
    if (desired + added).norm_squared() <= bound * bound {
        return 1.0;
    }
    let (square, mixed) = (added.norm_squared(), added.dot(desired));
    let room = (bound * bound - desired.norm_squared()).max(0.0);
    (room / (mixed + (mixed * mixed + square * room).sqrt())).clamp(0.0, 1.0)
}

fn scale_leg_accelerations(cycle: &Cycle<'_>, wanted: &Vector6<f64>) -> Vector6<f64> {
    let Parameters { limits, feedback_scale, law, .. } = &cycle.constants.parameters;
    let limit = limits.position.acceleration + cycle.constants.arm_m * limits.orientation.acceleration;
    let bounds =
        law.max_compensated_acceleration.map(|saturation| (1.0 + feedback_scale) * limit + saturation);
    let excess = wanted.component_div(&bounds).amax();
    if excess > 1.0 { wanted / excess } else { *wanted }
}
