//! Factorization of N at eight poses, one per lane: the blocks of [`super::factorization`], leg after leg in lane order.
//!
//! ```text
//! N = [ M_A  M_B ; D_A  D_B ]       A: the first three legs, B: the others
//! ```

use fearless_simd::{Simd, f64x8, prelude::*};
use nalgebra::Vector3;

use super::LEGS;
use super::lanes3::Lanes3;

/// Poses that are evaluated at once.
pub(super) const LANES: usize = 8;

/// Column of N.
#[derive(Clone, Copy)]
pub(super) struct Column<S: Simd> {
    pub moment: Lanes3<f64x8<S>>,
    pub direction: Lanes3<f64x8<S>>,
}

impl<S: Simd> Column<S> {
    #[inline(always)]
    pub fn new(arm: Lanes3<f64x8<S>>, direction: Lanes3<f64x8<S>>) -> Self {
        Self { moment: arm.cross(direction), direction }
    }

    #[inline(always)]
    pub fn zero(simd: S) -> Self {
        let zero = Lanes3::splat(simd, &Vector3::zeros());
        Self { moment: zero, direction: zero }
    }
}

/// Columns of a 3 x 3 matrix in each lane.
#[derive(Clone, Copy)]
pub(super) struct Matrix<S: Simd>(pub [Lanes3<f64x8<S>>; 3]);

impl<S: Simd> Matrix<S> {
    #[inline(always)]
    pub fn times(&self, v: Lanes3<f64x8<S>>) -> Lanes3<f64x8<S>> {
        let [x, y, z] = self.0;
        (z * v.z).plus_scaled(v.y, y).plus_scaled(v.x, x)
    }

    /// Product with the same vector in all lanes.
    #[inline(always)]
    pub fn times_vector(&self, simd: S, v: &Vector3<f64>) -> Lanes3<f64x8<S>> {
        self.times(Lanes3::splat(simd, v))
    }

    #[inline(always)]
    pub fn transposed_times(&self, v: Lanes3<f64x8<S>>) -> Lanes3<f64x8<S>> {
        let [x, y, z] = self.0;
        Lanes3 { x: x.dot(v), y: y.dot(v), z: z.dot(v) }
    }
}

/// One vector of each pose or motion.
#[inline(always)]
pub(super) fn vectors<S: Simd, T>(
    simd: S,
    poses: &[T; LANES],
    of: impl Fn(&T) -> Vector3<f64>,
) -> Lanes3<f64x8<S>> {
    Lanes3 {
        x: f64x8::load_array(simd, poses.each_ref().map(|pose| of(pose).x)),
        y: f64x8::load_array(simd, poses.each_ref().map(|pose| of(pose).y)),
        z: f64x8::load_array(simd, poses.each_ref().map(|pose| of(pose).z)),
    }
}

/// Factors of `N^-1` and `N^-T` in each lane, named as in [`super::factorization`].
pub(super) struct PoseFactorization<S: Simd> {
    moment_a: [Lanes3<f64x8<S>>; 3],
    inverse_a: [Lanes3<f64x8<S>>; 3],
    /// Matrix X: one array per j over the legs i.
    x: [[f64x8<S>; 3]; 3],
    adjugate_s: [Lanes3<f64x8<S>>; 3],
    inverse_d_s: f64x8<S>,
    pub d_a: f64x8<S>,
    pub d_s: f64x8<S>,
}

impl<S: Simd> PoseFactorization<S> {
    #[inline(always)]
    pub fn new(simd: S, [a0, a1, a2, b0, b1, b2]: [&Column<S>; LEGS]) -> Self {
        let one = f64x8::splat(simd, 1.0);
        let [c0, c1, c2] = adjugate([a0.direction, a1.direction, a2.direction]);
        let d_a = a0.direction.dot(c0);
        let inverse_d_a = one / d_a;
        let inverse_a = [c0 * inverse_d_a, c1 * inverse_d_a, c2 * inverse_d_a];
        let moment_a = [a0.moment, a1.moment, a2.moment];
        let x = [
            products(&inverse_a, b0.direction),
            products(&inverse_a, b1.direction),
            products(&inverse_a, b2.direction),
        ];
        let [x0, x1, x2] = &x;
        let s0 = eliminated(b0.moment, x0, &moment_a);
        let s1 = eliminated(b1.moment, x1, &moment_a);
        let s2 = eliminated(b2.moment, x2, &moment_a);
        let adjugate_s = adjugate([s0, s1, s2]);
        let d_s = s0.dot(adjugate_s[0]);
        Self { moment_a, inverse_a, x, adjugate_s, inverse_d_s: one / d_s, d_a, d_s }
    }

    /// Returns Gamma with `N Gamma = [torque; force]`.
    #[inline(always)]
    pub fn forces(&self, torque: Lanes3<f64x8<S>>, force: Lanes3<f64x8<S>>) -> [f64x8<S>; LEGS] {
        let ([x0, x1, x2], [c0, c1, c2]) = (&self.x, self.adjugate_s);
        let [g0, g1, g2] = products(&self.inverse_a, force);
        let rest = eliminated(torque, &[g0, g1, g2], &self.moment_a);
        let [h0, h1, h2] = [
            c0.dot(rest) * self.inverse_d_s,
            c1.dot(rest) * self.inverse_d_s,
            c2.dot(rest) * self.inverse_d_s,
        ];
        [
            g0 - h0 * x0[0] - h1 * x1[0] - h2 * x2[0],
            g1 - h0 * x0[1] - h1 * x1[1] - h2 * x2[1],
            g2 - h0 * x0[2] - h1 * x1[2] - h2 * x2[2],
            h0,
            h1,
            h2,
        ]
    }

    /// Returns omega and v with `N^T [omega; v] = rates`.
    #[inline(always)]
    pub fn twist(&self, [r0, r1, r2, r3, r4, r5]: [f64x8<S>; LEGS]) -> [Lanes3<f64x8<S>>; 2] {
        let ([x0, x1, x2], [m0, m1, m2]) = (&self.x, self.moment_a);
        let rest = [
            r3 - r0 * x0[0] - r1 * x0[1] - r2 * x0[2],
            r4 - r0 * x1[0] - r1 * x1[1] - r2 * x1[2],
            r5 - r0 * x2[0] - r1 * x2[1] - r2 * x2[2],
        ];
        let angular = combination(&rest, &self.adjugate_s) * self.inverse_d_s;
        let rest = [r0 - m0.dot(angular), r1 - m1.dot(angular), r2 - m2.dot(angular)];
        [angular, combination(&rest, &self.inverse_a)]
    }

    /// Square of the Frobenius norm of `N^-1`, torques divided by the radius, see [`super::sensitivity`].
    #[inline(always)]
    pub fn inverse_norm_squared(&self, radius_squared: f64x8<S>) -> f64x8<S> {
        let ([c0, c1, c2], [i0, i1, i2], [x0, x1, x2]) = (self.adjugate_s, self.inverse_a, &self.x);
        let t = [c0 * self.inverse_d_s, c1 * self.inverse_d_s, c2 * self.inverse_d_s];
        // Forces of the rows of B, with the other sign.
        let p = [
            combination(&products(&self.moment_a, t[0]), &self.inverse_a),
            combination(&products(&self.moment_a, t[1]), &self.inverse_a),
            combination(&products(&self.moment_a, t[2]), &self.inverse_a),
        ];
        let columns = [[x0[0], x1[0], x2[0]], [x0[1], x1[1], x2[1]], [x0[2], x1[2], x2[2]]];
        let [t0, t1, t2] =
            [combination(&columns[0], &t), combination(&columns[1], &t), combination(&columns[2], &t)];
        let p0 = i0 + combination(&columns[0], &p);
        let p1 = i1 + combination(&columns[1], &p);
        let p2 = i2 + combination(&columns[2], &p);
        let torques = sum_of_squares(&t) + sum_of_squares(&[t0, t1, t2]);
        torques * radius_squared + sum_of_squares(&p) + sum_of_squares(&[p0, p1, p2])
    }
}

/// Dot products with three vectors.
#[inline(always)]
fn products<S: Simd>([a, b, c]: &[Lanes3<f64x8<S>>; 3], v: Lanes3<f64x8<S>>) -> [f64x8<S>; 3] {
    [a.dot(v), b.dot(v), c.dot(v)]
}

/// Sum of multiples of three vectors.
#[inline(always)]
fn combination<S: Simd>([x, y, z]: &[f64x8<S>; 3], [a, b, c]: &[Lanes3<f64x8<S>>; 3]) -> Lanes3<f64x8<S>> {
    (*a * *x).plus_scaled(*y, *b).plus_scaled(*z, *c)
}

/// A vector less multiples of three others.
#[inline(always)]
fn eliminated<S: Simd>(
    v: Lanes3<f64x8<S>>,
    [x, y, z]: &[f64x8<S>; 3],
    [a, b, c]: &[Lanes3<f64x8<S>>; 3],
) -> Lanes3<f64x8<S>> {
    v.minus_scaled(*x, *a).minus_scaled(*y, *b).minus_scaled(*z, *c)
}

/// Cross products of the two other vectors, in cyclic order.
#[inline(always)]
fn adjugate<S: Simd>([a, b, c]: [Lanes3<f64x8<S>>; 3]) -> [Lanes3<f64x8<S>>; 3] {
    [b.cross(c), c.cross(a), a.cross(b)]
}

#[inline(always)]
fn sum_of_squares<S: Simd>([a, b, c]: &[Lanes3<f64x8<S>>; 3]) -> f64x8<S> {
    a.dot(*a) + b.dot(*b) + c.dot(*c)
}
