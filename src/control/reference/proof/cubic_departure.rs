//! By how much a quantity departs between two instants from the cubic with the same values and rates.
//!
//! With the arm r of the outermost joint and the peaks v, w of a stop, a joint moves at most at V = v + r w, and
//!
//! ```text
//! |s''|     <= A + r (Ar + w^2)                                       of a joint
//! |s'''|    <= J + r (Jr + 3 w Ar + w^3)
//! |L''|     <= |s''| + V^2 / L
//! |L'''|    <= |s'''| + 3 V |s''| / L + 2 V^3 / sqrt(3) L^2
//! ```
//!
//! Between two knots a quantity f with `|f'''| <= K` differs from the cubic with its values and rates at both by at most
//! `K dt^3 / 96`, its rate from that of the cubic by `K dt^2 / 30` (the integrals of Peano's kernels, the second rounded up). A cubic is
//! within the hull of its Bezier points, and so is its rate:
//!
//! ```text
//! f0,  f0 + f0' dt / 3,  f1 - f1' dt / 3,  f1              f0',  3 (f1 - f0) / dt - f0' - f1',  f1'
//! ```

use crate::control::constants::Constants;
use crate::control::signals::limits::Limits;

/// Largest departures from a cubic with the same values and rates at both ends, for a third derivative of one and a unit of time.
pub(in crate::control::reference) const CUBIC_DEPARTURE: f64 = 1.0 / 96.0;
pub(in crate::control::reference) const CUBIC_RATE_DEPARTURE: f64 = 1.0 / 30.0;
/// `2 / sqrt 3`: of the third derivative of a length by the turning of its leg alone.
const TURNING_SHARE: f64 = 1.154_700_538_379_251_7;

/// Largest third derivative of a leg's length at peak velocities.
pub(in crate::control::reference) fn length_jerk(constants: &Constants, v: f64, w: f64) -> f64 {
    let Limits { orientation, position, .. } = &constants.parameters.limits;
    let (arm, joint) = (constants.arm, v + constants.arm * w);
    let joint_acceleration = position.acceleration + arm * (orientation.acceleration + w * w);
    let joint_jerk =
        position.jerk + arm * (orientation.jerk + 3.0 * w * orientation.acceleration + w * w * w);
    let turning = joint / constants.machine().actuator.min_length;
    joint_jerk + turning * (3.0 * joint_acceleration + TURNING_SHARE * turning * joint)
}

/// Largest second derivative of a leg's length at peak velocities.
pub(in crate::control::reference) fn curvature(constants: &Constants, v: f64, w: f64) -> f64 {
    let Limits { orientation, position, .. } = &constants.parameters.limits;
    let joint = v + constants.arm * w;
    position.acceleration
        + constants.arm * (orientation.acceleration + w * w)
        + joint * joint / constants.machine().actuator.min_length
}
