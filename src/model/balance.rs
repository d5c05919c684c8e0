//! The 6 x 6 balance `N Gamma = W`, `N = [m; n]` with `m_i = b_i x n_i`, and its transpose
//! `N^T [omega; v] = L'`, by block elimination on two triples of legs, A and B.
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
//! Every 3 x 3 inverse is cross products of rotated lanes: two divisions in all, where an LU of the 6 x 6
//! matrix has six one after the other. A is the triple with the larger `|d|`, which is the pivoting.
//! One step of iterative refinement follows; its size measures the error of the first solution. Where it
//! is larger than the square root of the precision, which a second step would not mend (near singular
//! poses), LU with partial pivoting takes over, so no result is worse than that method's.

use fearless_simd::Simd;
use nalgebra::{Matrix6, Vector3, Vector6};

use super::inverse_geometry::LegGeometry;
use super::lanes::{Eight, Four, Lanes3, Reals, Triples};
use super::machine::LEGS;
use super::rigid::{Twist, Wrench};

/// `N^-1` and `N^-T` at one pose.
pub(super) struct Balance<S: Simd, V: Eight<S>> {
    simd: S,
    /// n and m of all legs.
    direction: Lanes3<V>,
    moment: Lanes3<V>,
    /// Whether A is the second half of the lanes.
    swapped: bool,
    /// m of A, per leg and each in all lanes.
    own_moment_a: Lanes3<V::Half>,
    moment_a: [Lanes3<V::Half>; 3],
    /// a / dA
    inverse_a: Lanes3<V::Half>,
    /// X: a vector for each i over the lanes j, and a vector for each j over the lanes i.
    x: [V::Half; 3],
    x_transposed: [V::Half; 3],
    /// c / dS
    inverse_s: Lanes3<V::Half>,
}

impl<S: Simd, V: Eight<S>> Balance<S, V> {
    /// Factorizes. At a singular pose the factors are not finite.
    #[inline(always)]
    pub fn new(simd: S, legs: &LegGeometry<V>) -> Self {
        let direction = legs.direction;
        let moment = legs.arm.cross(direction);
        // Of both triples at once.
        let next = direction.map(#[inline(always)] |component| component.next(simd));
        let adjugate = next.cross(direction.map(#[inline(always)] |component| component.previous(simd)));
        let (d0, d1) = direction.dot(adjugate).halves();
        let ((n0, n1), (m0, m1), (a0, a1)) = (direction.halves(), moment.halves(), adjugate.halves());
        let ([size0, ..], [size1, ..]) = (d0.legs(), d1.legs());
        let swapped = size1.abs() > size0.abs();
        let (a, d, n_b, m_a, m_b) = if swapped { (a1, d1, n0, m1, m0) } else { (a0, d0, n1, m0, m1) };
        let inverse_a = a * (V::Half::splat(simd, 1.0) / d);
        let [i0, i1, i2] = broadcast_vectors(simd, inverse_a);
        let x = [i0.dot(n_b), i1.dot(n_b), i2.dot(n_b)];
        let moment_a = broadcast_vectors(simd, m_a);
        let s = minus_combination(m_b, &moment_a, &x);
        let next = s.map(#[inline(always)] |component| component.next(simd));
        let c = next.cross(s.map(#[inline(always)] |component| component.previous(simd)));
        let inverse_s = c * (V::Half::splat(simd, 1.0) / s.dot(c));
        let x_transposed = V::Half::transposed(simd, x);
        Self { simd, direction, moment, swapped, own_moment_a: m_a, moment_a, inverse_a, x, x_transposed, inverse_s }
    }

    /// Gamma with `N (Gamma - drive) = W`; `None` at a singular pose.
    #[inline(always)]
    pub fn forces(&self, triples: &Triples, wrench: &Wrench, drive: V) -> Option<[f64; LEGS]> {
        let first = self.forces_once(wrench);
        let balanced = Wrench {
            torque: (self.moment * first).sum_legs(),
            force: (self.direction * first).sum_legs(),
        };
        let residual =
            Wrench { torque: wrench.torque - balanced.torque, force: wrench.force - balanced.force };
        let correction = self.forces_once(&residual);
        let gamma = first + correction;
        // Squares: so the share is the square root of the precision. False for what is not a number.
        if (correction * correction).sum() <= V::EPSILON * (gamma * gamma).sum() {
            return Some(triples.unpack(&(gamma + drive).store()));
        }
        let n = wrench_columns(triples, self.moment, self.direction);
        let gamma = n.lu().solve(&wrench.vector())?;
        Some((gamma + Vector6::from(triples.unpack(&drive.store()))).into())
    }

    #[inline(always)]
    fn forces_once(&self, wrench: &Wrench) -> V {
        let g = self.inverse_a.dot(splat(self.simd, &wrench.force));
        let torque = minus_combination(splat(self.simd, &wrench.torque), &self.moment_a, &broadcasts(self.simd, g));
        let gamma_b = self.inverse_s.dot(torque);
        let [g0, g1, g2] = broadcasts(self.simd, gamma_b);
        let [x0, x1, x2] = self.x_transposed;
        let gamma_a = g - (g0 * x0 + g1 * x1 + g2 * x2);
        if self.swapped { V::join(gamma_b, gamma_a) } else { V::join(gamma_a, gamma_b) }
    }

    /// `[omega; v]` with `N^T [omega; v] = rates`; not finite at a singular pose.
    #[inline(always)]
    pub fn twist(&self, rates: V) -> Twist {
        let first = self.twist_once(rates);
        let correction = self.twist_once(rates - self.rates(&first));
        Twist {
            angular: first.angular + correction.angular,
            linear: first.linear + correction.linear,
        }
    }

    /// [`Balance::twist`] without refinement: for iterations that correct themselves.
    #[inline(always)]
    pub fn twist_once(&self, rates: V) -> Twist {
        let (r0, r1) = rates.halves();
        let (r_a, r_b) = if self.swapped { (r1, r0) } else { (r0, r1) };
        let [g0, g1, g2] = broadcasts(self.simd, r_a);
        let [x0, x1, x2] = self.x;
        let angular = (self.inverse_s * (r_b - (g0 * x0 + g1 * x1 + g2 * x2))).sum();
        let own = self.own_moment_a.dot(splat(self.simd, &angular));
        Twist { angular, linear: (self.inverse_a * (r_a - own)).sum() }
    }

    /// `N^T [omega; v]`
    #[inline(always)]
    fn rates(&self, twist: &Twist) -> V {
        let (angular, linear) = (Lanes3::splat(self.simd, &twist.angular), Lanes3::splat(self.simd, &twist.linear));
        self.moment.dot(angular) + self.direction.dot(linear)
    }
}

/// N, columns in the order of people.
pub(super) fn wrench_columns<S: Simd, V: Eight<S>>(
    triples: &Triples,
    moment: Lanes3<V>,
    direction: Lanes3<V>,
) -> Matrix6<f64> {
    let rows = [moment.store(), direction.store()];
    let mut n = Matrix6::zeros();
    for (mut row, lane) in n.row_iter_mut().zip(rows.iter().flatten()) {
        row.copy_from_slice(&triples.unpack(lane));
    }
    n
}

/// Each leg's number in all lanes.
#[inline(always)]
fn broadcasts<S: Simd, F: Four<S>>(simd: S, v: F) -> [F; 3] {
    [v.broadcast::<0>(simd), v.broadcast::<1>(simd), v.broadcast::<2>(simd)]
}

/// Each leg's vector in all lanes.
#[inline(always)]
fn broadcast_vectors<S: Simd, F: Four<S>>(simd: S, v: Lanes3<F>) -> [Lanes3<F>; 3] {
    let ([x0, x1, x2], [y0, y1, y2], [z0, z1, z2]) =
        (broadcasts(simd, v.x), broadcasts(simd, v.y), broadcasts(simd, v.z));
    [Lanes3 { x: x0, y: y0, z: z0 }, Lanes3 { x: x1, y: y1, z: z1 }, Lanes3 { x: x2, y: y2, z: z2 }]
}

/// `v - sum_i s_i u_i`
#[inline(always)]
fn minus_combination<F: Reals>(v: Lanes3<F>, [u0, u1, u2]: &[Lanes3<F>; 3], [s0, s1, s2]: &[F; 3]) -> Lanes3<F> {
    v.plus_scaled(-*s0, *u0).plus_scaled(-*s1, *u1).plus_scaled(-*s2, *u2)
}

#[inline(always)]
fn splat<S: Simd, F: Four<S>>(simd: S, v: &Vector3<f64>) -> Lanes3<F> {
    Lanes3 { x: F::splat(simd, v.x), y: F::splat(simd, v.y), z: F::splat(simd, v.z) }
}
