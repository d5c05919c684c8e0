//! Vector of three numbers in four lanes.

use nalgebra::Vector3;

/// Three numbers and a zero.
pub(in crate::control::reference) type Padded = [f64; 4];

/// The numbers of a vector, and a zero.
#[inline(always)]
pub(in crate::control::reference) fn padded(v: &Vector3<f64>) -> Padded {
    [v.x, v.y, v.z, 0.0]
}
