//! Displacement of a motion by a quintic in time: the way onto the setpoint, to rest, and home.
//!
//! An autonomous motion is a base motion displaced by a vector that follows a quintic in time. The quintic meets
//! given displacement, rate and acceleration at both ends, so acceleration is continuous and jerk bounded.
//!
//! | motion | base | displacement |
//! | --- | --- | --- |
//! | engaging | the setpoint | from where the platform is, to zero |
//! | stopping | where it began, at rest | from zero, along the motion, until at rest |
//! | parking | home, at rest | from where the platform is, to zero |

#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix3, Vector3, Vector6};

use super::input_validation::seconds_between;
use super::limits::{DerivativeLimits, Limits};
use crate::model::rigid::{Acceleration, Motion, Pose, Twist, exp};

/// Shortest duration of a segment \[s\]: some cycles, also without displacement.
const MIN_DURATION_S: f64 = 0.02;

/// Displacement `[rotation vector; vector]` of a base motion as a quintic in time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct QuinticOffset {
    /// Coefficients of 1, t, ... t^5.
    coefficients: [Vector6<f64>; 6],
    duration_s: f64,
    start_ns: u64,
}

impl QuinticOffset {
    /// From a displacement with its derivatives to zero, as fast as `limits` times `autonomous_scale` allow.
    pub fn to_zero(
        start_ns: u64,
        displacement: &Twist,
        rate: &Twist,
        acceleration: &Acceleration,
        limits: &Limits,
    ) -> Self {
        let from = [displacement.vector(), rate.vector(), acceleration.vector()];
        let scaled = |axis: &DerivativeLimits| axis.scaled(limits.autonomous_scale);
        let limits = [scaled(&limits.orientation), scaled(&limits.position)];
        Self::quintic(start_ns, longer_duration_s(&limits, &from, duration_to_zero_s), from, Vector6::zeros())
    }

    /// From zero displacement with a rate and an acceleration until at rest: the rate follows a cubic.
    pub fn to_rest(start_ns: u64, rate: &Twist, acceleration: &Acceleration, limits: &Limits) -> Self {
        let (v, a) = (rate.vector(), acceleration.vector());
        let from = [Vector6::zeros(), v, a];
        let duration_s = longer_duration_s(&[limits.orientation, limits.position], &from, duration_to_rest_s);
        let end = (v * 0.5 + a * (duration_s / 12.0)) * duration_s;
        Self::quintic(start_ns, duration_s, from, end)
    }

    /// The quintic from `[d, d', d'']` to `end` at rest.
    fn quintic(start_ns: u64, t: f64, [d, v, a]: [Vector6<f64>; 3], end: Vector6<f64>) -> Self {
        let h = end - d;
        let coefficients = [
            d,
            v,
            a * 0.5,
            (h * 20.0 - v * (12.0 * t) - a * (3.0 * t * t)) / (2.0 * t.powi(3)),
            (h * -30.0 + v * (16.0 * t) + a * (3.0 * t * t)) / (2.0 * t.powi(4)),
            (h * 12.0 - v * (6.0 * t) - a * (t * t)) / (2.0 * t.powi(5)),
        ];
        Self { coefficients, duration_s: t, start_ns }
    }

    /// Whether an instant is at the end or after it.
    pub fn has_ended(&self, instant_ns: u64) -> bool {
        self.seconds(instant_ns) >= self.duration_s
    }

    /// The displacement at the end.
    pub fn end(&self) -> Vector6<f64> {
        let t = self.duration_s;
        let [c0, c1, c2, c3, c4, c5] = &self.coefficients;
        c0 + (c1 + (c2 + (c3 + (c4 + c5 * t) * t) * t) * t) * t
    }

    /// The base motion displaced by the quintic. Before the start the quintic is extrapolated: a measurement is
    /// slightly older than the cycle that began the segment.
    pub fn displace(&self, base: &Motion, instant_ns: u64) -> Motion {
        let t = self.seconds(instant_ns).min(self.duration_s);
        let [c0, c1, c2, c3, c4, c5] = &self.coefficients;
        let d = c0 + (c1 + (c2 + (c3 + (c4 + c5 * t) * t) * t) * t) * t;
        let v = c1 + (c2 * 2.0 + (c3 * 3.0 + (c4 * 4.0 + c5 * (5.0 * t)) * t) * t) * t;
        let a = c2 * 2.0 + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * t)) * t) * t;
        displaced(base, &Twist::from_vector(&d), &Twist::from_vector(&v), &Acceleration::from_vector(&a))
    }

    fn seconds(&self, instant_ns: u64) -> f64 {
        seconds_between(self.start_ns, instant_ns)
    }
}

/// The longer of the durations \[s\] that rotation and translation need.
fn longer_duration_s(
    limits: &[DerivativeLimits; 2],
    [d, v, a]: &[Vector6<f64>; 3],
    duration_s: impl Fn(&DerivativeLimits, f64, f64, f64) -> f64,
) -> f64 {
    let norms = |of: &Vector6<f64>| [of.fixed_rows::<3>(0).norm(), of.fixed_rows::<3>(3).norm()];
    let ([d_r, d_p], [v_r, v_p], [a_r, a_p]) = (norms(d), norms(v), norms(a));
    let [orientation, position] = limits;
    MIN_DURATION_S.max(duration_s(orientation, d_r, v_r, a_r)).max(duration_s(position, d_p, v_p, a_p))
}

/// Duration of the quintic from d, v, a to zero. Upper bounds of peak velocity, acceleration and jerk are `1.875 d / T`,
/// `5.774 d / T^2 + 6 v / T + a` and `60 d / T^3 + 36 v / T^2 + 9 a / T`. Where the second is within the limit A, the third
/// is at most `10.39 A / T`, so that T has a closed form.
fn duration_to_zero_s(limit: &DerivativeLimits, d: f64, v: f64, a: f64) -> f64 {
    // At least half of the limit is for the displacement.
    let free = (limit.acceleration - a).max(0.5 * limit.acceleration);
    let by_velocity = 1.875 * d / limit.velocity;
    let by_acceleration = (3.0 * v + (9.0 * v * v + 5.774 * d * free).sqrt()) / free;
    by_velocity.max(by_acceleration).max(10.39 * limit.acceleration.max(a) / limit.jerk)
}

/// Duration in which a cubic profile of the velocity goes from v, with slope a, to rest. Its peaks are at most `1.5 v / T + a / 3`, or a, and
/// `6 v / T^2 + 4 a / T`.
fn duration_to_rest_s(limit: &DerivativeLimits, _: f64, v: f64, a: f64) -> f64 {
    let free = (limit.acceleration - a / 3.0).max(0.2 * limit.acceleration);
    let by_jerk = (2.0 * a + (4.0 * a * a + 6.0 * v * limit.jerk).sqrt()) / limit.jerk;
    (1.5 * v / free).max(by_jerk)
}

/// Motion displaced by `[dw; dv](t)`: `R = exp(dw) R_b`, `C = C_b + dv`.
///
/// `omega = J dw' + exp(dw) omega_b` with the left Jacobian J of SO(3) to the second order in dw. A
/// displacement along one axis is exact; one of 0.2 rad that turns its axis is exact to a thousandth.
fn displaced(base: &Motion, d: &Twist, rate: &Twist, acceleration: &Acceleration) -> Motion {
    let rotation = exp(&d.angular);
    let tilde = d.angular.cross_matrix();
    let jacobian = Matrix3::identity() + tilde * 0.5 + tilde * tilde / 6.0;
    let added: Vector3<f64> = jacobian * rate.angular;
    let rotated = rotation * base.twist.angular;
    let curvature = rate.angular.cross(&d.angular.cross(&rate.angular)) / 6.0;
    Motion {
        pose: Pose { rotation: rotation * base.pose.rotation, position: base.pose.position + d.linear },
        twist: Twist { angular: added + rotated, linear: base.twist.linear + rate.linear },
        acceleration: Acceleration {
            angular: jacobian * acceleration.angular
                + curvature
                + added.cross(&rotated)
                + rotation * base.acceleration.angular,
            linear: base.acceleration.linear + acceleration.linear,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::task::TaskState;

    const LIMITS: Limits = Limits {
        position: DerivativeLimits { velocity: 0.5, acceleration: 5.0, jerk: 100.0 },
        orientation: DerivativeLimits { velocity: 1.0, acceleration: 10.0, jerk: 200.0 },
        autonomous_scale: 1.0,
    };

    fn twist(numbers: [f64; 6]) -> Twist {
        Twist::from_vector(&numbers.into())
    }

    fn moving() -> Motion {
        TaskState {
            x: Vector6::new(0.1, -0.2, 0.3, 0.01, 0.02, 0.7),
            xd: Vector6::new(0.3, -0.1, 0.2, 0.1, -0.2, 0.05),
            xdd: Vector6::new(1.0, -0.5, 0.2, 0.3, 1.0, -0.7),
        }
        .motion()
    }

    /// Asserts at every instant that the derivatives are those of the pose and that limits are kept.
    fn assert_smooth(segment: &QuinticOffset, base: &Motion, limits: Option<&Limits>) {
        let h_ns = 100_000;
        let h = 1e-4;
        let mut before: Option<Motion> = None;
        for instant_ns in (segment.start_ns..segment.start_ns + 3_000_000_000).step_by(1_000_000) {
            let now = segment.displace(base, instant_ns);
            let later = segment.displace(base, instant_ns + h_ns);
            let earlier = segment.displace(base, instant_ns - h_ns);
            if !segment.has_ended(instant_ns) {
                let twist = earlier.pose.displacement_to(&later.pose).vector() / (2.0 * h);
                assert!((twist - now.twist.vector()).norm() < 2e-4, "{twist} {}", now.twist.vector());
                let acceleration = (later.twist.vector() - earlier.twist.vector()) / (2.0 * h);
                assert!((acceleration - now.acceleration.vector()).norm() < 0.05, "{acceleration}");
            }
            if let Some(limits) = limits {
                assert!(now.acceleration.linear.norm() <= limits.position.acceleration * 1.001);
                assert!(now.acceleration.angular.norm() <= limits.orientation.acceleration * 1.001);
                if let Some(before) = before.replace(now) {
                    let jerk = (now.acceleration.linear - before.acceleration.linear).norm() / 1e-3;
                    assert!(jerk <= limits.position.jerk * 1.001, "{jerk}");
                }
            }
        }
        let end = segment.start_ns + 4_000_000_000;
        assert!(segment.has_ended(end));
    }

    #[test]
    fn a_displacement_of_a_pose_at_rest_decays_within_the_limits() {
        let base = TaskState::at_rest([0.1, 0.2, 0.3, 0.0, 0.0, 1.0]).motion();
        let d = twist([0.1, -0.05, 0.1, 0.02, -0.03, 0.01]);
        let segment =
            QuinticOffset::to_zero(5_000_000_000, &d, &twist([0.0; 6]), &Acceleration::default(), &LIMITS);
        let first = segment.displace(&base, 5_000_000_000);
        assert!((base.pose.displacement_to(&first.pose).vector() - d.vector()).norm() < 1e-14);
        assert_smooth(&segment, &base, Some(&LIMITS));
        let last = segment.displace(&base, 9_000_000_000);
        assert!((last.pose.rotation - base.pose.rotation).norm() < 1e-12);
        assert!((last.pose.position - base.pose.position).norm() < 1e-12);
    }

    #[test]
    fn a_displacement_of_a_moving_pose_starts_with_its_rate() {
        let base = moving();
        let (d, v) =
            (twist([0.004, 0.001, -0.002, 0.001, 0.002, 0.0]), twist([0.02, 0.0, 0.01, 0.0, 0.01, 0.0]));
        let segment = QuinticOffset::to_zero(7, &d, &v, &Acceleration::default(), &LIMITS);
        let added = segment.displace(&base, 7).twist.vector() - base.twist.vector();
        assert!((added - v.vector()).norm() < 1e-2, "{added}");
    }

    #[test]
    fn a_motion_comes_to_rest_with_continuous_acceleration() {
        let motion = moving();
        let base = Motion { pose: motion.pose, ..TaskState::at_rest([0.0; 6]).motion() };
        let segment = QuinticOffset::to_rest(5_000_000_000, &motion.twist, &motion.acceleration, &LIMITS);
        let first = segment.displace(&base, 5_000_000_000);
        assert!((first.twist.vector() - motion.twist.vector()).norm() < 1e-12);
        assert!((first.acceleration.vector() - motion.acceleration.vector()).norm() < 1e-12);
        assert_smooth(&segment, &base, Some(&LIMITS));
        let last = segment.displace(&base, 9_000_000_000);
        assert!(last.twist.vector().norm() < 1e-12 && last.acceleration.vector().norm() < 1e-9);
    }

    #[test]
    fn a_segment_without_displacement_has_the_minimum_duration() {
        let segment = QuinticOffset::to_rest(9, &twist([0.0; 6]), &Acceleration::default(), &LIMITS);
        assert!(!segment.has_ended(9) && segment.has_ended(9 + 20_000_001));
    }
}
