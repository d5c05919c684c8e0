//! Factorization of `N` by block elimination on two triples of legs, A and B. It solves the balance of forces
//! `N Gamma = W`, `N = [m; n]` with `m_i = b_i x n_i`, and the transpose `N^T [omega; v] = L'`.
//!
//! ```text
//! a_i  = n_i+1 x n_i+2          dA = n_i . a_i           rows of D_A^-1 = a_i / dA        (i in A, cyclic)
//! X_ij = a_i . n_j / dA         S_j = m_j - sum_i m_i X_ij
//! c_j  = S_j+1 x S_j+2          dS = S_j . c_j           rows of S^-1 = c_j / dS          (j in B, cyclic)
//!
//! forces of [t; f]:   g_i = a_i . f / dA      Gamma_j = c_j . (t - sum_i m_i g_i) / dS
//!                                             Gamma_i = g_i - sum_j X_ij Gamma_j
//! twist of r:         omega = sum_j c_j (r_j - sum_i X_ij r_i) / dS
//!                     v = sum_i a_i (r_i - m_i . omega) / dA
//! ```
//!
//! Every 3 x 3 inverse consists of cross products of rotated lanes. This takes two divisions in all; an LU of
//! the 6 x 6 matrix has six, one after the other. Pivoting is done in advance: [`Triples::best`] splits the
//! legs so that A spans the largest volume at home. If a pose is too close to a singularity of A or of S (the
//! determinants are available), LU with partial pivoting takes over. Over many poses the error is at most
//! twice the error of LU.

use fearless_simd::{Level, Simd, f64x4, f64x8, prelude::*};
use nalgebra::{Matrix6, Vector6};
use serde::{Deserialize, Serialize};

use super::LEGS;
use super::inverse_geometry::LegGeometry;
use super::lanes::{LaneArithmetic as _, Triple};
use super::lanes3::{Lanes3, broadcasts};
use super::lu;
use super::machine::Joints;
use super::rigid::{Twist, Wrench};
use super::triples::{LegLanes, Triples};

/// Smallest `|dA|`, the volume spanned by the three unit vectors of A, for which the blocks are used.
///
/// Measured (2026-11-20, `tests/near_singular`, 53 830 motions, condition 1 to 1e13): largest error per
/// decade of the condition, relative to LU with partial pivoting, forces / twist: 28 / 28 with 0.03 (and dS
/// 1e-2), 4.2 / 3.4 with 0.1, 4.2 / 2.6 with 0.15, **1.3 / 1.5 with 0.2**, the same with 0.25; RMS 0.7 to
/// 1.0. The ten machines of `tests/data` have 0.22 to 0.98 in their vectors.
const MIN_DET_A: f64 = 0.2;

/// Smallest `|dS| / radius^3` for which the blocks are used. If A is well conditioned, block elimination
/// stays accurate even when S is nearly singular (each lane is Cramer's rule, forward stable). But two
/// singular values may become small together, and then cross products cancel. Measured as above: 1.5 with
/// 1e-2 and with 1e-3, 2.3 with 1e-4. Vectors of `tests/data`: 1.2 to 5.
const MIN_RELATIVE_DET_S: f64 = 1e-3;

/// Factors of `N^-1` and `N^-T` at one pose.
pub(super) struct Factorization<'a, S: Simd> {
    pub simd: S,
    pub joints: &'a Joints,
    /// Moments m of A.
    pub moment_a: Lanes3<f64x4<S>>,
    /// Inverse of D_A, rows `a / dA`.
    pub inverse_a: Lanes3<f64x4<S>>,
    /// Matrix X: one vector per i over the lanes j.
    pub x: [f64x4<S>; 3],
    /// Adjugate of S, rows c.
    pub adjugate_s: Lanes3<f64x4<S>>,
    /// `1 / dS`, computed by each lane for its own leg.
    pub inverse_d_s: f64x4<S>,
    /// dA and dS, computed by the first leg of each triple.
    pub determinants: [f64; 2],
    /// Whether both determinants are large enough for block elimination.
    pub uses_blocks: bool,
}

/// Stored [`Factorization`]: each [`LegLanes`] holds the lanes of two factors.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct StoredFactorization {
    /// m of A, and c.
    moment_adjugate: [LegLanes; 3],
    /// `a / dA`, and X.
    inverse_x: [LegLanes; 3],
    /// `1 / dS`, stored twice.
    inverse_d_s: LegLanes,
    determinants: [f64; 2],
    pub uses_blocks: bool,
}

/// Wrench about C, as the sum of four lanes.
pub(super) struct LaneWrench<S: Simd> {
    pub torque: Lanes3<f64x4<S>>,
    pub force: Lanes3<f64x4<S>>,
}

impl<'a, S: Simd> Factorization<'a, S> {
    /// Factorizes N. At a singular pose the factors are not finite.
    #[inline(always)]
    pub fn new(simd: S, joints: &'a Joints, legs: &LegGeometry<S>) -> Self {
        let moment = legs.arm.cross(legs.direction);
        let ((n_a, n_b), (moment_a, m_b)) = (legs.direction.split(), moment.split());
        let one = f64x4::splat(simd, 1.0);

        let a = adjugate(n_a);
        let d_a = n_a.dot(a);
        let inverse_a = a * (one / d_a);
        let [i0, i1, i2] = inverse_a.broadcasts();
        let x = [i0.dot(n_b), i1.dot(n_b), i2.dot(n_b)];
        let [x0, x1, x2] = x;
        let [m0, m1, m2] = moment_a.broadcasts();
        let s = m_b.minus_scaled(x0, m0).minus_scaled(x1, m1).minus_scaled(x2, m2);
        let c = adjugate(s);
        let d_s = s.dot(c);
        let inverse_d_s = one / d_s;

        let ([d_a, ..], [d_s, ..]) = (d_a.legs(), d_s.legs());
        let uses_blocks = are_regular_blocks(d_a, d_s, joints.radius_cubed_m3);
        let determinants = [d_a, d_s];
        Self { simd, joints, moment_a, inverse_a, x, adjugate_s: c, inverse_d_s, determinants, uses_blocks }
    }

    /// Loads a stored factorization.
    #[inline(always)]
    pub fn load(simd: S, joints: &'a Joints, factors: &StoredFactorization) -> Self {
        let load = |lane: &LegLanes| lane.load(simd).split();
        let [(m_x, c_x), (m_y, c_y), (m_z, c_z)] = factors.moment_adjugate.each_ref().map(load);
        let [(i_x, x_0), (i_y, x_1), (i_z, x_2)] = factors.inverse_x.each_ref().map(load);
        Self {
            simd,
            joints,
            moment_a: Lanes3 { x: m_x, y: m_y, z: m_z },
            inverse_a: Lanes3 { x: i_x, y: i_y, z: i_z },
            x: [x_0, x_1, x_2],
            adjugate_s: Lanes3 { x: c_x, y: c_y, z: c_z },
            inverse_d_s: load(&factors.inverse_d_s).0,
            determinants: factors.determinants,
            uses_blocks: factors.uses_blocks,
        }
    }

    /// Stores the factorization.
    #[inline(always)]
    pub fn store(&self) -> StoredFactorization {
        let (m, i, c, [x_0, x_1, x_2]) = (self.moment_a, self.inverse_a, self.adjugate_s, self.x);
        let store = |first: f64x4<S>, second: f64x4<S>| LegLanes::from(first.combine(second));
        StoredFactorization {
            moment_adjugate: [store(m.x, c.x), store(m.y, c.y), store(m.z, c.z)],
            inverse_x: [store(i.x, x_0), store(i.y, x_1), store(i.z, x_2)],
            inverse_d_s: store(self.inverse_d_s, self.inverse_d_s),
            determinants: self.determinants,
            uses_blocks: self.uses_blocks,
        }
    }

    /// `det N`, with the columns in lane order.
    #[inline(always)]
    pub fn determinant(&self) -> f64 {
        let [d_a, d_s] = self.determinants;
        -d_a * d_s
    }

    /// Returns `Gamma + axial_n` with `N Gamma = W`, in lanes; `None` at a singular pose.
    #[inline(always)]
    pub fn forces(
        &self,
        legs: &LegGeometry<S>,
        wrench: &LaneWrench<S>,
        axial_n: f64x8<S>,
    ) -> Option<LegLanes> {
        let simd = self.simd;
        let triples = &self.joints.triples;
        if !self.uses_blocks {
            let n = wrench_columns(triples, legs);
            let forces = forces_by_lu(simd.level(), &n, &wrench.sum(), &triples.unpack(&axial_n.into()))?;
            return Some(triples.pack(&forces));
        }
        let force = wrench.force.total();
        let g = self.inverse_a.dot(force);
        // The lane of padding is not a leg: its force is set to zero.
        let g_of_legs = g * f64x4::load_array(simd, [1.0, 1.0, 1.0, 0.0]);
        let torque = wrench.torque.minus_scaled(g_of_legs, self.moment_a);
        let gamma_b = self.adjugate_s.dot(torque.total()) * self.inverse_d_s;
        let [g0, g1, g2] = broadcasts(gamma_b);
        let [x0, x1, x2] = Triple::transposed(self.x);
        let gamma_a = g - g0 * x0 - g1 * x1 - g2 * x2;
        Some((gamma_a.combine(gamma_b) + axial_n).into())
    }

    /// Returns `[omega; v]` with `N^T [omega; v] = rates_m_s`; `None` at a singular pose.
    #[inline(always)]
    pub fn twist(&self, legs: &LegGeometry<S>, rates_m_s: f64x8<S>) -> Option<LaneTwist<S>> {
        let simd = self.simd;
        if !self.uses_blocks {
            let triples = &self.joints.triples;
            let n = wrench_columns(triples, legs);
            return twist_by_lu(simd.level(), &n, &triples.unpack(&rates_m_s.into())).map(
                #[inline(always)]
                |twist| LaneTwist::splat(simd, &twist),
            );
        }
        // The lane of padding is not a leg: its rate is set to zero.
        let of_legs = f64x4::load_array(simd, [1.0, 1.0, 1.0, 0.0]);
        let (r_a, r_b) = rates_m_s.split();
        let [r0, r1, r2] = broadcasts(r_a);
        let [x0, x1, x2] = self.x;
        // One dS for all three lanes. Near a singular pose the lanes' own values differ by rounding times the
        // condition. Large terms cancel in the sum, so the error would be multiplied by the condition a
        // second time.
        let inverse_d_s = self.inverse_d_s.broadcast::<0>();
        let rest = (r_b - r0 * x0 - r1 * x1 - r2 * x2) * of_legs;
        let angular = (self.adjugate_s * rest).total() * inverse_d_s;
        let rest = (r_a - self.moment_a.dot(angular)) * of_legs;
        Some(LaneTwist { angular, linear: (self.inverse_a * rest).total() })
    }
}

/// Twist, each component in all lanes.
#[derive(Clone, Copy)]
pub(super) struct LaneTwist<S: Simd> {
    pub angular: Lanes3<f64x4<S>>,
    pub linear: Lanes3<f64x4<S>>,
}

impl<S: Simd> LaneTwist<S> {
    #[inline(always)]
    fn splat(simd: S, twist: &Twist) -> Self {
        Self { angular: Lanes3::splat(simd, &twist.angular), linear: Lanes3::splat(simd, &twist.linear) }
    }

    /// Weighted square of the twist: `|omega|^2 + |v|^2 linear_weight`.
    #[inline(always)]
    pub fn size_squared(&self, linear_weight: f64x4<S>) -> f64 {
        let linear = self.linear.dot(self.linear);
        linear.fused_mul_add(linear_weight, self.angular.dot(self.angular)).first()
    }

    /// Twist as two 3-vectors.
    #[inline(always)]
    pub fn first(&self) -> Twist {
        Twist { angular: self.angular.first(), linear: self.linear.first() }
    }
}

impl<S: Simd> LaneWrench<S> {
    /// Wrench as two 3-vectors.
    pub fn sum(&self) -> Wrench {
        Wrench { torque: self.torque.sum(), force: self.force.sum() }
    }
}

/// Forces by LU with partial pivoting.
#[cold]
#[inline(never)]
fn forces_by_lu(level: Level, n: &Matrix6<f64>, wrench: &Wrench, axial: &[f64; LEGS]) -> Option<[f64; LEGS]> {
    let balancing = lu::solve(level, &n.transpose().into(), &wrench.vector().into())?;
    Some((Vector6::from(balancing) + Vector6::from(*axial)).into())
}

/// Twist by LU with partial pivoting.
#[cold]
#[inline(never)]
fn twist_by_lu(level: Level, n: &Matrix6<f64>, rates: &[f64; LEGS]) -> Option<Twist> {
    // The columns of N are the rows of its transpose.
    lu::solve(level, n.as_ref(), rates).map(|twist| Twist::from_vector(&twist.into()))
}

/// Matrix N, columns in the order of the legs.
#[inline(always)]
pub(super) fn wrench_columns<S: Simd>(triples: &Triples, legs: &LegGeometry<S>) -> Matrix6<f64> {
    let rows = [legs.arm.cross(legs.direction).store(), legs.direction.store()];
    let mut n = Matrix6::zeros();
    for (mut row, lanes) in n.row_iter_mut().zip(rows.iter().flatten()) {
        row.copy_from_slice(&triples.unpack(lanes));
    }
    n
}

/// Whether both determinants are large enough for block elimination; `radius_cubed_m3` is a field of [`Joints`].
#[inline(always)]
pub(super) fn are_regular_blocks(d_a: f64, d_s: f64, radius_cubed_m3: f64) -> bool {
    d_a.abs() >= MIN_DET_A && d_s.abs() >= MIN_RELATIVE_DET_S * radius_cubed_m3
}

/// Returns `v_i+1 x v_i+2` in each lane i.
#[inline(always)]
fn adjugate<S: Simd>(v: Lanes3<f64x4<S>>) -> Lanes3<f64x4<S>> {
    v.next().cross(v.previous())
}
