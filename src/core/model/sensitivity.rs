//! Sensitivity of a pose, from its factorization: condition, determinant, and trusted step, for which
//! Newton's method is proved to converge.
//!
//! ```text
//! condition = |N| |N^-1|      determinant = det N / radius^3      trusted_step = h / (|K| |N^-1|),  h = 0.4
//! ```
//!
//! Norms are Frobenius norms; torques are taken about the mean of the joints and divided by the radius. Valid
//! at every pose. At a singular pose the condition is not finite and the trusted step is zero or NaN.

use fearless_simd::{Level, Simd, f64x4, f64x8, prelude::*};
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};

use super::factorization::{Factorization, wrench_columns};
use super::inverse_geometry::LegGeometry;
use super::lanes::{LaneArithmetic as _, Triple};
use super::lu;
use super::machine::Joints;

/// Largest Frobenius norm of N: the root of 12, from six directions and six arms whose mean square is 1. No
/// moment exceeds its arm.
pub const MAX_LEG_WRENCHES_NORM: f64 = 3.464_101_615_137_755;

/// Explanation of the condition in reports.
pub const CONDITION_MEANING: &str = "6 is best; errors and forces grow with it";

/// Sensitivity of a pose to errors of the leg lengths. All values are dimensionless: torques and angles refer
/// to the radius.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// Frobenius condition of N: at least the 2-norm condition and at most six times it; not finite at a
    /// singular pose.
    pub condition: f64,
    /// Frobenius norm of N: between `sqrt 6` and `sqrt 12`.
    pub norm: f64,
    /// `det N / radius^3`; its sign changes where the platform crosses a singular pose.
    pub determinant: f64,
    /// Largest step (radian, or radius) for which Newton's method is proved to find the only pose nearby.
    pub trusted_step: f64,
}

/// Largest h of a trusted step, by Kantorovich's theorem. Let `h = B K s <= 1/2` at the start (B norm of the
/// inverse Jacobian, K Lipschitz constant of the Jacobian, s size of the first step). Then Newton's method
/// converges quadratically to a solution, and there is no other solution within the radius
/// `(1 - sqrt(1 - 2 h)) / (B K)`. K is taken at the start. Its growth along the step costs less than the
/// fifth of h that is left.
pub(super) const MAX_KANTOROVICH_H: f64 = 0.4;

impl Sensitivity {
    /// Computes the sensitivity from legs with arms from the mean of the joints, and from their
    /// factorization.
    ///
    /// Along a step `(dw, dv)` the second derivative of a length L is at most
    /// `(|dv| + |dw| a)^2 / L + |dw|^2 a`, a the length of the arm. With `rho = a / radius` this gives a
    /// Lipschitz constant `K_i radius = (1 + rho^2) radius / L + rho` per leg, and the root of the sum of
    /// squares for all six.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        joints: &Joints,
        legs: &LegGeometry<S>,
        factorization: &Factorization<S>,
    ) -> Self {
        let (sensitivity, _) = Self::with_largest_row(simd, joints, legs, factorization);
        sensitivity
    }

    /// The sensitivity, and the largest norm of a row of `N^-1`.
    #[inline(always)]
    pub(super) fn with_largest_row<S: Simd>(
        simd: S,
        joints: &Joints,
        legs: &LegGeometry<S>,
        factorization: &Factorization<S>,
    ) -> (Self, f64) {
        let inverse_radius = f64x8::splat(simd, 1.0 / joints.radius_m);
        let (share, arm_curvature) = (joints.arm_share.load(simd), joints.arm_curvature.load(simd));
        let curvature = arm_curvature.fused_mul_add(legs.inverse_length_per_m, share);
        let moment = legs.arm.cross(legs.direction) * inverse_radius;
        let (curvature, wrench) =
            (sum_legs(curvature * curvature), sum_legs(moment.dot(moment) + f64x8::splat(simd, 1.0)));
        let [inverse, largest_row] = inverse_norms_squared(factorization, legs);
        let sensitivity = Self {
            condition: (wrench * inverse).sqrt(),
            norm: wrench.sqrt(),
            determinant: factorization.determinant() * joints.inverse_radius_cubed_per_m3,
            trusted_step: MAX_KANTOROVICH_H / (curvature * inverse).sqrt(),
        };
        (sensitivity, largest_row.sqrt())
    }
}

#[inline(always)]
fn sum_legs<S: Simd>(v: f64x8<S>) -> f64 {
    let (first, second) = v.split();
    (first + second).legs().into_iter().sum()
}

/// Squares of the Frobenius norm of `N^-1`, and of the norm of its largest row, torques divided by the
/// radius. They bound the leg forces that balance a unit wrench, in newtons at the radius. Not finite at a
/// singular pose.
///
/// ```text
/// rows of B: torque t_j = c_j / dS               force p_j = -sum_i (t_j . m_i) a_i / dA
/// rows of A: torque     - sum_j X_ij t_j         force a_i / dA - sum_j X_ij p_j
/// ```
#[inline(always)]
fn inverse_norms_squared<S: Simd>(factorization: &Factorization<S>, legs: &LegGeometry<S>) -> [f64; 2] {
    let simd = factorization.simd;
    if !factorization.uses_blocks {
        let n = wrench_columns(&factorization.joints.triples, legs);
        return inverse_norms_squared_by_lu(simd.level(), &n, factorization.joints.radius_m);
    }
    let r = f64x4::splat(simd, factorization.joints.radius_m);
    let [i0, i1, i2] = factorization.inverse_a.broadcasts();
    let [m0, m1, m2] = factorization.moment_a.broadcasts();
    let t = factorization.adjugate_s * factorization.inverse_d_s;
    let p = (i0 * t.dot(m0)).plus_scaled(t.dot(m1), i1).plus_scaled(t.dot(m2), i2) * f64x4::splat(simd, -1.0);
    let [x0, x1, x2] = Triple::transposed(factorization.x);
    let ([t0, t1, t2], [p0, p1, p2]) = (t.broadcasts(), p.broadcasts());
    let torque_a = (t0 * x0).plus_scaled(x1, t1).plus_scaled(x2, t2);
    let force_a = factorization.inverse_a.minus_scaled(x0, p0).minus_scaled(x1, p1).minus_scaled(x2, p2);
    let row = |torque: f64x4<S>, force: f64x4<S>| (torque * r).fused_mul_add(r, force);
    let (torque_b, torque_a) = (t.dot(t), torque_a.dot(torque_a));
    let (force_b, force_a) = (p.dot(p), force_a.dot(force_a));
    let largest = row(torque_b, force_b).max(row(torque_a, force_a)).legs().into_iter().fold(0.0, f64::max);
    [row(torque_b + torque_a, force_b + force_a).legs().into_iter().sum(), largest]
}

/// The same norms by elimination with partial pivoting.
#[cold]
#[inline(never)]
fn inverse_norms_squared_by_lu(level: Level, n: &Matrix6<f64>, radius: f64) -> [f64; 2] {
    // The columns of N are the rows of its transpose.
    let weights = [radius, radius, radius, 1.0, 1.0, 1.0];
    lu::inverse_norms_squared(level, n.as_ref(), &weights).unwrap_or([f64::INFINITY; 2])
}
