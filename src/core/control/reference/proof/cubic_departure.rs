//! Bounds on the departure of a quantity from a cubic between two instants. The cubic has the same values and
//! rates at both instants.
//!
//! A stop has the peak velocities v and w. With the arm r of the outermost joint, a joint on the platform
//! moves at most at `V = v + r w`. The position of the joint is s, the length of its leg L:
//!
//! ```text
//! |s''|     <= A + r (Ar + w^2)
//! |s'''|    <= J + r (Jr + 3 w Ar + w^3)
//! |L''|     <= |s''| + V^2 / L
//! |L'''|    <= |s'''| + 3 V |s''| / L + 2 V^3 / sqrt(3) L^2
//! ```
//!
//! If `|f'''| <= K` between two knots, a quantity f differs from its cubic by at most `K dt^3 / 96`. The rate
//! of f differs from the rate of the cubic by at most `K dt^2 / 30`. Both bounds are integrals of Peano's
//! kernels; the second is rounded up. A cubic is within the hull of its Bezier points, and its rate is within
//! the hull of its own:
//!
//! ```text
//! f0,  f0 + f0' dt / 3,  f1 - f1' dt / 3,  f1              f0',  3 (f1 - f0) / dt - f0' - f1',  f1'
//! ```

use crate::control::constants::Constants;
use crate::control::signals::limits::Limits;

/// Largest departures of a value and of a rate from the cubic, for a third derivative of 1 over a time of 1.
pub(in crate::control::reference) const CUBIC_DEPARTURE_RATIO: f64 = 1.0 / 96.0;
pub(in crate::control::reference) const CUBIC_RATE_DEPARTURE_RATIO: f64 = 1.0 / 30.0;
/// `2 / sqrt 3`: factor in the third derivative of a length, due to the turning of the leg alone.
const LEG_TURNING_JERK_FACTOR: f64 = 1.154_700_538_379_251_7;

/// Bound on the third derivative of a leg's length, for the peak velocities v and w of a stop.
pub(in crate::control::reference) fn length_jerk_bound(constants: &Constants, v: f64, w: f64) -> f64 {
    let Limits { orientation, position, .. } = &constants.parameters.limits;
    let (arm, joint) = (constants.arm_m, v + constants.arm_m * w);
    let joint_acceleration = position.acceleration + arm * (orientation.acceleration + w * w);
    let joint_jerk =
        position.jerk + arm * (orientation.jerk + 3.0 * w * orientation.acceleration + w * w * w);
    let turning = joint / constants.machine().actuator.min_length_m;
    joint_jerk + turning * (3.0 * joint_acceleration + LEG_TURNING_JERK_FACTOR * turning * joint)
}

/// Bound on the second derivative of a leg's length, for the peak velocities v and w of a stop.
pub(in crate::control::reference) fn length_acceleration_bound(constants: &Constants, v: f64, w: f64) -> f64 {
    let Limits { orientation, position, .. } = &constants.parameters.limits;
    let joint = v + constants.arm_m * w;
    position.acceleration
        + constants.arm_m * (orientation.acceleration + w * w)
        + joint * joint / constants.machine().actuator.min_length_m
}
