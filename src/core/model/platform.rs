//! Mobile platform (paper, eq. 88-93): wrench that its own motion requires.
//!
//! ```text
//! S = omega'~ + omega~ omega~          acceleration of a point r of the platform: v' + S r
//! f = m (v' + S c - g)                 c = R CG
//! torque about C = c x f + sum_k p_k x S p_k                              torque first, as in the paper
//! ```
//!
//! The `p_k` are the principal axes of the mass distribution about its centre, in base axes, scaled so that
//! `sum_k p_k p_k^T = integral of r r^T dm`. The sum is `I omega' + omega x I omega` with
//! `I = sum_k (|p_k|^2 - p_k p_k^T)`. In this form the platform consists of points, which the lanes of the
//! legs can evaluate too. The centre of mass is the point in the legs' padding (see
//! `super::leg::LegConstants`); the three axes are one more triple of lanes.
//!
//! Difference from the print: (88), (93) have g with the sign opposite to (74)-(81). (90), (91) combine an
//! inertia about the centre of mass with moments about C and lack the parallel-axis term, here `c x f`.

use fearless_simd::{Simd, SimdBase, f64x4};
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::lanes3::Lanes3;
use super::machine::Machine;
use super::rigid::{Acceleration, Twist};

/// Principal axes `p_k` in platform axes: x, y, z over the lanes k.
#[derive(Clone, Debug)]
pub(super) struct PrincipalAxes([[f64; 4]; 3]);

impl PrincipalAxes {
    pub fn new(machine: &Machine) -> Self {
        let inertia = &machine.platform.inertia;
        let distribution = Matrix3::identity() * (0.5 * inertia.trace()) - inertia;
        let SymmetricEigen { eigenvectors, eigenvalues } = distribution.symmetric_eigen();
        // A flat plate has one eigenvalue of zero, or slightly below by rounding.
        let axes = eigenvectors * Matrix3::from_diagonal(&eigenvalues.map(|value| value.max(0.0).sqrt()));
        let row = |x: &Vector3<f64>| [x.x, x.y, x.z, 0.0];
        let rows = axes.transpose();
        Self([row(&rows.column(0).into()), row(&rows.column(1).into()), row(&rows.column(2).into())])
    }

    /// `p_k x S p_k` with k in lanes; the sum of the lanes is the torque of the rotation.
    #[inline(always)]
    pub fn torques<S: Simd>(
        &self,
        simd: S,
        rotation: &Matrix3<f64>,
        acceleration_map: &Matrix3<f64>,
    ) -> Lanes3<f64x4<S>> {
        let [x, y, z] = self.0.map(|row| f64x4::load_array(simd, row));
        let p = Lanes3 { x, y, z }.transformed(simd, rotation);
        p.cross(p.transformed(simd, acceleration_map))
    }

    /// The same per unit of the angular acceleration about x, y and z, from rest: columns of `|p_k|^2 - p_k p_k^T`.
    #[inline(always)]
    pub fn inertia<S: Simd>(&self, simd: S, rotation: &Matrix3<f64>) -> [Lanes3<f64x4<S>>; 3] {
        let [x, y, z] = self.0.map(|row| f64x4::load_array(simd, row));
        let p = Lanes3 { x, y, z }.transformed(simd, rotation);
        let square = p.dot(p);
        let [mut x, mut y, mut z] = [p * -p.x, p * -p.y, p * -p.z];
        (x.x, y.y, z.z) = (x.x + square, y.y + square, z.z + square);
        [x, y, z]
    }
}

/// Matrix S, which takes a point of the platform (from C, in base axes) to its acceleration relative to C.
#[inline(always)]
pub(super) fn acceleration_map(twist: &Twist, acceleration: &Acceleration) -> Matrix3<f64> {
    let (w, a) = (&twist.angular, &acceleration.angular);
    let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
    let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
    Matrix3::new(-yy - zz, xy - a.z, xz + a.y, xy + a.z, -xx - zz, yz - a.x, xz - a.y, yz + a.x, -xx - yy)
}
