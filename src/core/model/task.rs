//! Task coordinates `X = [alpha beta gamma x y z]` (paper, eq. 1) and the motion that they describe.
//!
//! `R = Rx(alpha) Ry(beta) Rz(gamma)`; `omega = E(alpha, beta) [alpha' beta' gamma']`. The columns of E are
//! the three joint axes of the rotation, so E is always defined. Its inverse does not exist at beta = +-90
//! deg, but the cyclic loop never needs it: angles are read only at the edges of the program.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix3, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use super::rigid::{Acceleration, Motion, Pose, Twist};

/// Cosine of beta up to which only the sum or the difference of alpha and gamma is determined.
const MIN_COS_BETA: f64 = 1e-12;

/// Cosine of beta from which on alpha and gamma have derivatives: rounding of omega is a part of 1e-10 of them.
const MIN_COS_BETA_IN_MOTION: f64 = 1e-6;

/// Motion in task coordinates at one instant: Bryan angles \[rad\], position \[m\], and their time derivatives.
///
/// X' and X'' hold angle rates, not angular velocity:
///
/// ```
/// use hexad_core::model::task::TaskState;
/// let state = TaskState { xd: [0.0, 0.0, 2.0, 0.0, 0.0, 0.0].into(), ..TaskState::at_rest([0.0, 0.5, 0.0, 0.0, 0.0, 1.0]) };
/// // gamma turns about the platform's z axis, which beta has inclined.
/// let omega = state.motion().twist.angular;
/// assert!((omega - nalgebra::Vector3::new(2.0 * 0.5_f64.sin(), 0.0, 2.0 * 0.5_f64.cos())).norm() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TaskState {
    /// X
    pub x: Vector6<f64>,
    /// X'
    pub xd: Vector6<f64>,
    /// X''
    pub xdd: Vector6<f64>,
}

impl TaskState {
    /// The state at X without motion.
    pub fn at_rest(x: [f64; 6]) -> Self {
        Self { x: x.into(), ..Self::default() }
    }

    /// The state `dt_s` seconds later (or earlier) if X'' stays as it is.
    pub fn after(&self, dt_s: f64) -> Self {
        Self {
            x: self.x + (self.xd + self.xdd * (0.5 * dt_s)) * dt_s,
            xd: self.xd + self.xdd * dt_s,
            xdd: self.xdd,
        }
    }

    /// The same state with derivatives with respect to a time that runs `rate_ratio` times as fast as theirs.
    pub fn at_rate(&self, rate_ratio: f64) -> Self {
        Self { x: self.x, xd: self.xd * rate_ratio, xdd: self.xdd * rate_ratio * rate_ratio }
    }

    /// Pose, twist and acceleration in base axes.
    pub fn motion(&self) -> Motion {
        let [alpha, beta, gamma, x, y, z] = self.x.into();
        let [alpha_rate, beta_rate, gamma_rate, vx, vy, vz] = self.xd.into();
        let [alpha_accel, beta_accel, gamma_accel, ax, ay, az] = self.xdd.into();
        let [(sa, ca), (sb, cb), (sg, cg)] = [alpha, beta, gamma].map(libm::sincos);
        let (sa_sb, ca_sb) = (sa * sb, ca * sb);
        // Columns of E, and the angular velocity of each column.
        let e1 = Vector3::x();
        let e2 = Vector3::new(0.0, ca, sa);
        let e3 = Vector3::new(sb, -sa * cb, ca * cb);
        let omega_2 = e1 * alpha_rate;
        let omega_3 = omega_2 + e2 * beta_rate;
        let rotation = Matrix3::from_columns(&[
            Vector3::new(cb * cg, ca * sg + sa_sb * cg, sa * sg - ca_sb * cg),
            Vector3::new(-cb * sg, ca * cg - sa_sb * sg, sa * cg + ca_sb * sg),
            e3,
        ]);
        Motion {
            pose: Pose { rotation, position: Vector3::new(x, y, z) },
            twist: Twist { angular: omega_3 + e3 * gamma_rate, linear: Vector3::new(vx, vy, vz) },
            acceleration: Acceleration {
                angular: e1 * alpha_accel
                    + e2 * beta_accel
                    + e3 * gamma_accel
                    + omega_2.cross(&e2) * beta_rate
                    + omega_3.cross(&e3) * gamma_rate,
                linear: Vector3::new(ax, ay, az),
            },
        }
    }

    /// State of a motion, the inverse of [`TaskState::motion`], with the triple of Bryan angles nearest to `near`. None near
    /// beta = +-90 deg, where alpha and gamma have no derivatives.
    ///
    /// Conditioning: errors of the rates of alpha and gamma grow with `1 / cos(beta)`, those of their accelerations with its square.
    pub fn of_motion(motion: &Motion, near: &[f64; 6]) -> Option<Self> {
        let x = task_coordinates(&motion.pose, near);
        let [alpha, beta, ..] = x;
        let [(sa, ca), (sb, cb)] = [alpha, beta].map(libm::sincos);
        // E^-1 times a vector.
        let rates = |omega: Vector3<f64>| {
            let gamma_rate = (ca * omega.z - sa * omega.y) / cb;
            Vector3::new(omega.x - sb * gamma_rate, ca * omega.y + sa * omega.z, gamma_rate)
        };
        let joined = |angular: Vector3<f64>, linear: Vector3<f64>| {
            Vector6::new(angular.x, angular.y, angular.z, linear.x, linear.y, linear.z)
        };
        let xd = joined(rates(motion.twist.angular), motion.twist.linear);
        // What omega' is of these rates alone.
        let steady = Self { x: x.into(), xd, xdd: Vector6::zeros() }.motion().acceleration.angular;
        let xdd = joined(rates(motion.acceleration.angular - steady), motion.acceleration.linear);
        (cb.abs() >= MIN_COS_BETA_IN_MOTION).then_some(Self { x: x.into(), xd, xdd })
    }

    /// The same motion with the triple of Bryan angles nearest to `near`, as of [`task_coordinates`]. Where only the sum or the
    /// difference of alpha and gamma is determined, a state in motion keeps its own.
    pub fn nearest_to(&self, near: &[f64; 6]) -> Self {
        let [alpha, beta, gamma, ..]: [f64; 6] = self.x.into();
        if libm::cos(beta).abs() <= MIN_COS_BETA && *self == Self::at_rest(self.x.into()) {
            return Self::at_rest(task_coordinates(&self.motion().pose, near));
        }
        let mut nearest = *self;
        let ([alpha, beta, gamma], is_mirrored) = nearest_angles([alpha, beta, gamma], near);
        (nearest.x.x, nearest.x.y, nearest.x.z) = (alpha, beta, gamma);
        if is_mirrored {
            (nearest.xd.y, nearest.xdd.y) = (-self.xd.y, -self.xdd.y);
        }
        nearest
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        // Zero times infinity or NaN is NaN: one comparison instead of a branch per number.
        (self.x * 0.0 + self.xd * 0.0 + self.xdd * 0.0).sum() == 0.0
    }
}

/// The pose of X.
pub fn pose_of(x: &[f64; 6]) -> Pose {
    TaskState::at_rest(*x).motion().pose
}

/// Task coordinates of a pose. Two triples of Bryan angles (plus full turns) give the same R; the triple
/// nearest to `near` is returned, so that a continuous motion has continuous angles.
///
/// ```
/// use hexad_core::model::task::{TaskState, task_coordinates};
/// let x = [3.5, 0.2, -4.0, 0.1, 0.2, 1.0];
/// let back = task_coordinates(&TaskState::at_rest(x).motion().pose, &x);
/// assert!(back.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-14));
/// ```
///
/// Conditioning: errors of alpha and gamma grow with `1 / cos(beta)`. At beta = +-90 deg only their sum or
/// difference is determined; alpha is then taken from `near`.
pub fn task_coordinates(pose: &Pose, near: &[f64; 6]) -> [f64; 6] {
    let r = &pose.rotation;
    let [near_alpha, ..] = *near;
    let cos_beta = libm::hypot(r.m11, r.m12);
    let beta = libm::atan2(r.m13, cos_beta);
    let (alpha, gamma) = if cos_beta > MIN_COS_BETA {
        (libm::atan2(-r.m23, r.m33), libm::atan2(-r.m12, r.m11))
    } else {
        // R = Rx(alpha) Ry(+-90 deg) Rz(gamma): row 2 and 3 hold alpha +- gamma.
        let rest = rotation_y(-beta) * rotation_x(-near_alpha) * r;
        (near_alpha, libm::atan2(rest.m21, rest.m22))
    };
    let ([alpha, beta, gamma], _) = nearest_angles([alpha, beta, gamma], near);
    [alpha, beta, gamma, pose.position.x, pose.position.y, pose.position.z]
}

/// Of the triples of Bryan angles that give the same R, the one nearest to `near`, and whether beta is mirrored in it: `pi - beta`.
#[inline]
fn nearest_angles([alpha, beta, gamma]: [f64; 3], near: &[f64; 6]) -> ([f64; 3], bool) {
    let [near_alpha, near_beta, near_gamma, ..] = *near;
    let pi = core::f64::consts::PI;
    let nearest = |angle: f64, near: f64| angle + ((near - angle) / (2.0 * pi)).round() * 2.0 * pi;
    let candidate = |alpha: f64, beta: f64, gamma: f64| {
        [nearest(alpha, near_alpha), nearest(beta, near_beta), nearest(gamma, near_gamma)]
    };
    let distance =
        |[a, b, c]: [f64; 3]| (a - near_alpha).powi(2) + (b - near_beta).powi(2) + (c - near_gamma).powi(2);
    let first = candidate(alpha, beta, gamma);
    let second = candidate(alpha + pi, pi - beta, gamma + pi);
    if distance(first) <= distance(second) { (first, false) } else { (second, true) }
}

fn rotation_x(angle: f64) -> Matrix3<f64> {
    let (s, c) = libm::sincos(angle);
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

fn rotation_y(angle: f64) -> Matrix3<f64> {
    let (s, c) = libm::sincos(angle);
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;

    #[test]
    fn coordinates_invert_the_pose_through_gimbal_lock() {
        for beta in [-1.4, 0.0, 1.5, FRAC_PI_2 - 1e-6, FRAC_PI_2, FRAC_PI_2 + 1e-6, 1.7, 3.0] {
            let x = [2.9, beta, -2.0, 0.1, -0.2, 0.3];
            let pose = TaskState::at_rest(x).motion().pose;
            let back = task_coordinates(&pose, &x);
            let again = TaskState::at_rest(back).motion().pose;
            assert!((again.rotation - pose.rotation).amax() < 1e-14);
            assert!(back.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-9), "{back:?} for {x:?}");
        }
    }

    #[test]
    fn the_nearest_triple_describes_the_same_motion() {
        let state = TaskState {
            x: Vector6::new(0.3, 1.4, -3.0, 0.1, 0.2, 1.0),
            xd: Vector6::new(1.0, -2.0, 0.5, 0.3, 0.0, -0.1),
            xdd: Vector6::new(-3.0, 1.0, 2.0, 0.0, 1.0, 0.5),
        };
        for near in [[0.4, 1.5, 3.2, 0.0, 0.0, 0.0], [3.4, 1.7, 0.2, 0.0, 0.0, 0.0]] {
            let nearest = state.nearest_to(&near);
            let distance = (nearest.x - Vector6::from(near)).rows(0, 3).amax();
            assert!(distance < 0.2, "{}", nearest.x);
            let (a, b) = (state.motion(), nearest.motion());
            assert!((a.pose.rotation - b.pose.rotation).amax() < 1e-14);
            assert!((a.twist.vector() - b.twist.vector()).amax() < 1e-14);
            assert!((a.acceleration.vector() - b.acceleration.vector()).amax() < 1e-13);
            let again = TaskState::of_motion(&a, &near).unwrap();
            assert!((again.x - nearest.x).amax() < 1e-14 && (again.xd - nearest.xd).amax() < 1e-13);
            assert!((again.xdd - nearest.xdd).amax() < 1e-12, "{}", again.xdd - nearest.xdd);
        }
        let locked = TaskState::at_rest([1.0, FRAC_PI_2, 0.5, 0.0, 0.0, 1.0]);
        let nearest = locked.nearest_to(&[0.7, 1.5, 0.8, 0.0, 0.0, 1.0]);
        assert!(
            (nearest.x - Vector6::new(0.7, FRAC_PI_2, 0.8, 0.0, 0.0, 1.0)).amax() < 1e-14,
            "{}",
            nearest.x
        );
        assert_eq!(TaskState::of_motion(&locked.motion(), &locked.x.into()), None);
    }
}
