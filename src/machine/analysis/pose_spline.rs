//! Derivatives of a motion of which only poses are given: the quintic spline through them, at rest at both ends.
//!
//! Of all motions through the poses it has the least square of jerk. X, X', X'' and the two derivatives after them are
//! continuous. Between two knots it is the quintic of [`interpolate`](hexad_core::motion::trajectory::interpolate), so what is
//! checked and played is this motion. Noise of the poses becomes acceleration: `noise / step^2`.
//!
//! ```text
//! with the steps p before and q after a knot, continuity of the third and fourth derivative gives (v = X', a = X'')
//! -24/p^2 v- - 3/p a-    + (36/q^2 - 36/p^2) v + (9/p + 9/q) a        + 24/q^2 v+ - 3/q a+     = 60 dX+/q^3 - 60 dX-/p^3
//! -168/p^3 v- - 24/p^2 a- - (192/p^3 + 192/q^3) v + (36/p^2 - 36/q^2) a - 168/q^3 v+ + 24/q^2 a+ = -360 dX+/q^4 - 360 dX-/p^4
//! ```

use nalgebra::{Matrix2, SMatrix};

use hexad_core::motion::trajectory::Knot;

/// Both derivatives of all coordinates.
type Derivatives = SMatrix<f64, 2, 6>;

/// Sets X' and X'' of knots whose times increase strictly. `None` if their steps are too unequal for the numbers' digits.
pub fn complete(knots: &mut [Knot]) -> Option<()> {
    // In units of the mean step, so that all numbers are of one size.
    let (first, last) = (knots.first()?.t_s, knots.last()?.t_s);
    let unit_s = if knots.len() > 1 { (last - first) / (knots.len() - 1) as f64 } else { 1.0 };
    // Elimination: derivatives of a knot = known - gain * those of the next.
    let mut eliminated = Vec::with_capacity(knots.len());
    let (mut gain, mut known) = (Matrix2::zeros(), Derivatives::zeros());
    eliminated.push((gain, known));
    for window in knots.windows(3) {
        let [before, knot, after] = window else { continue };
        let (p, q) = ((knot.t_s - before.t_s) / unit_s, (after.t_s - knot.t_s) / unit_s);
        let lower = Matrix2::new(-24.0 / (p * p), -3.0 / p, -168.0 / (p * p * p), -24.0 / (p * p));
        let middle = Matrix2::new(
            36.0 / (q * q) - 36.0 / (p * p),
            9.0 / p + 9.0 / q,
            -192.0 / (p * p * p) - 192.0 / (q * q * q),
            36.0 / (p * p) - 36.0 / (q * q),
        );
        let upper = Matrix2::new(24.0 / (q * q), -3.0 / q, -168.0 / (q * q * q), 24.0 / (q * q));
        let (left, right) =
            ((knot.state.x - before.state.x) / (p * p * p), (after.state.x - knot.state.x) / (q * q * q));
        let (jerk, snap) = ((right - left) * 60.0, (left / p + right / q) * -360.0);
        let wanted = Derivatives::from_rows(&[jerk.transpose(), snap.transpose()]);
        let inverse = (middle - lower * gain).try_inverse()?;
        (gain, known) = (inverse * upper, inverse * (wanted - lower * known));
        eliminated.push((gain, known));
    }
    let mut next = Derivatives::zeros();
    let count = knots.len();
    for (k, knot) in knots.iter_mut().enumerate().rev() {
        let is_end = k == 0 || k + 1 == count;
        let (gain, known) = eliminated.get(k).copied().unwrap_or_default();
        next = if is_end { Derivatives::zeros() } else { known - gain * next };
        knot.state.xd = next.row(0).transpose() / unit_s;
        knot.state.xdd = next.row(1).transpose() / (unit_s * unit_s);
        if !(knot.state.xd.amax() + knot.state.xdd.amax()).is_finite() {
            return None;
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_core::model::task::TaskState;
    use hexad_core::motion::minimum_jerk::rise;
    use hexad_core::motion::trajectory::interpolate;
    use nalgebra::Vector6;

    /// A quintic from rest to rest is the spline through its own poses, however uneven their times.
    #[test]
    fn a_minimum_jerk_move_is_reproduced_from_its_poses() {
        let exact = |t: f64| {
            let profile = rise(t, 2.0);
            let way = Vector6::new(0.1, -0.2, 0.3, 1.0, -2.0, 0.5);
            TaskState {
                x: way * profile.value_share,
                xd: way * profile.rate_per_s,
                xdd: way * profile.accel_per_s2,
            }
        };
        let mut knots = [0.0, 0.1, 0.7, 0.75, 1.2, 1.9, 2.0]
            .map(|t_s| Knot { t_s, state: TaskState::at_rest(exact(t_s).x.into()) });
        complete(&mut knots).unwrap();
        for k in 0..=40 {
            let t = 0.05 * f64::from(k);
            let (found, wanted) = (interpolate(&knots, t).unwrap(), exact(t));
            assert!((found.x - wanted.x).amax() < 1e-12, "{t}");
            assert!((found.xd - wanted.xd).amax() < 1e-10, "{t}");
            assert!((found.xdd - wanted.xdd).amax() < 1e-9, "{t}");
        }
    }

    /// Many knots of a sine within rests: as near as its fourth derivative allows.
    #[test]
    fn a_dense_motion_has_its_derivatives() {
        let (h, count) = (0.01, 801);
        let exact = |t: f64| {
            let window = hexad_core::motion::minimum_jerk::window(t, 8.0, 2.0);
            let (s, c) = (3.0 * t).sin_cos();
            [
                window.value_share * s,
                window.rate_per_s * s + 3.0 * window.value_share * c,
                window.accel_per_s2 * s + 6.0 * window.rate_per_s * c - 9.0 * window.value_share * s,
            ]
        };
        let mut knots: Vec<_> = (0..count)
            .map(|k| {
                let t_s = h * f64::from(k);
                Knot { t_s, state: TaskState::at_rest([exact(t_s)[0]; 6]) }
            })
            .collect();
        complete(&mut knots).unwrap();
        let mut worst = [0.0_f64; 2];
        for knot in &knots {
            let [_, rate, accel] = exact(knot.t_s);
            worst[0] = worst[0].max((knot.state.xd[0] - rate).abs());
            worst[1] = worst[1].max((knot.state.xdd[0] - accel).abs());
        }
        assert!(worst[0] < 1e-5 && worst[1] < 5e-3, "{worst:?}");
    }

    #[test]
    fn one_and_two_poses_are_at_rest() {
        for count in [1, 2] {
            let mut knots: Vec<_> = (0..count)
                .map(|k| Knot { t_s: f64::from(k), state: TaskState::at_rest([f64::from(k); 6]) })
                .collect();
            complete(&mut knots).unwrap();
            assert!(knots.iter().all(|knot| knot.state.xd.amax() == 0.0 && knot.state.xdd.amax() == 0.0));
        }
        assert!(complete(&mut []).is_none());
    }
}
