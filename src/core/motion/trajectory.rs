//! A trajectory given by rows of X, X', X'': quintic interpolation between them.
//!
//! Between two rows the six conditions at both ends determine one polynomial of fifth order per
//! coordinate, so X, X' and X'' of the result belong to each other and have no steps.

use nalgebra::Vector6;

use crate::model::task::TaskState;

/// Knot of a trajectory: a time with X, X', X''.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// \[s\]
    pub t_s: f64,
    /// X, X', X''.
    pub state: TaskState,
}

/// The state at `t_s`, clamped to the knots' range; `None` without knots. Their times increase strictly.
///
/// ```
/// use hexad_core::{model::task::TaskState, motion::trajectory::{Knot, interpolate}};
/// let knot = |t_s, z| Knot { t_s, state: TaskState::at_rest([0.0, 0.0, 0.0, 0.0, 0.0, z]) };
/// let knots = [knot(0.0, 1.0), knot(2.0, 1.2)];
/// // From rest to rest: the minimum-jerk move, halfway at half the time.
/// let middle = interpolate(&knots, 1.0).unwrap();
/// assert!((middle.x[5] - 1.1).abs() < 1e-15 && (middle.xd[5] - 0.2 * 1.875 / 2.0).abs() < 1e-15);
/// ```
pub fn interpolate(knots: &[Knot], t_s: f64) -> Option<TaskState> {
    let after = knots.partition_point(|knot| knot.t_s <= t_s);
    let Some(b) = knots.get(after) else { return knots.last().map(|knot| knot.state) };
    let Some(a) = after.checked_sub(1).and_then(|before| knots.get(before)) else { return Some(b.state) };
    Some(quintic(&a.state, &b.state, t_s - a.t_s, b.t_s - a.t_s))
}

/// The quintic from `a` to `b` over `h` seconds, at `t_s`.
fn quintic(a: &TaskState, b: &TaskState, t: f64, h: f64) -> TaskState {
    // c0 + c1 t + c2 t^2 as at a; c3, c4, c5 make up the difference at b, in units of u = t / h.
    let missing = b.x - a.after(h).x;
    let missing_rate = (b.xd - a.after(h).xd) * h;
    let missing_accel = (b.xdd - a.xdd) * (h * h);
    let c3: Vector6<f64> = missing * 10.0 - missing_rate * 4.0 + missing_accel * 0.5;
    let c4: Vector6<f64> = missing * -15.0 + missing_rate * 7.0 - missing_accel;
    let c5: Vector6<f64> = missing * 6.0 - missing_rate * 3.0 + missing_accel * 0.5;
    let u = t / h;
    let start = a.after(t);
    TaskState {
        x: start.x + (c3 + (c4 + c5 * u) * u) * (u * u * u),
        xd: start.xd + (c3 * 3.0 + (c4 * 4.0 + c5 * (5.0 * u)) * u) * (u * u / h),
        xdd: start.xdd + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * u)) * u) * (u / (h * h)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quintic_is_reproduced_with_its_derivatives() {
        let exact = |t: f64| TaskState {
            x: Vector6::repeat(1.0 - t + t.powi(3) - 0.2 * t.powi(5)),
            xd: Vector6::repeat(-1.0 + 3.0 * t.powi(2) - t.powi(4)),
            xdd: Vector6::repeat(6.0 * t - 4.0 * t.powi(3)),
        };
        let knots = [0.0, 0.3, 1.1, 2.0].map(|t_s| Knot { t_s, state: exact(t_s) });
        for k in 0..=20 {
            let t = 0.1 * f64::from(k);
            let (found, wanted) = (interpolate(&knots, t).unwrap(), exact(t));
            assert!((found.x - wanted.x).amax() < 1e-12);
            assert!((found.xd - wanted.xd).amax() < 1e-12);
            assert!((found.xdd - wanted.xdd).amax() < 1e-11);
        }
        assert_eq!(interpolate(&knots, -1.0).unwrap(), exact(0.0));
        assert_eq!(interpolate(&knots, 9.0).unwrap(), exact(2.0));
    }
}
