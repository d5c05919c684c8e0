//! Conditioning of a pose: the numbers of a [kinematic state](super::kinematic_state) without its
//! factorization. Proofs about neighbouring poses begin with it.

use fearless_simd::dispatch;

use super::factorization::Factorization;
use super::inverse_geometry::LegGeometry;
use super::lanes::least_of_legs;
use super::machine::Machine;
use super::rigid::Pose;
use super::sensitivity::Sensitivity;

/// Conditioning of a pose.
#[derive(Clone, Copy, Debug)]
pub struct Conditioning {
    /// Condition and norm of N.
    pub sensitivity: Sensitivity,
    /// Largest norm of a row of `N^-1`, as in the sensitivity.
    pub largest_row_norm: f64,
    /// Length of the shortest leg \[m\].
    pub shortest_leg_m: f64,
    /// See [`super::inverse_geometry::universal_sine`].
    pub universal_sine: f64,
    /// Whether the blocks of the factorization are too close to singular, so that LU with pivoting replaced
    /// them.
    pub is_pivoted: bool,
}

impl Conditioning {
    /// Evaluates the conditioning of a machine at a pose.
    pub fn new(machine: &Machine, pose: &Pose) -> Self {
        let joints = &machine.joints;
        dispatch!(machine.level, simd => {
            let legs = LegGeometry::around_center(simd, joints, pose);
            let factorization = Factorization::new(simd, joints, &legs);
            let (sensitivity, largest_row_norm) =
                Sensitivity::with_largest_row(simd, joints, &legs, &factorization);
            Self {
                largest_row_norm,
                sensitivity,
                shortest_leg_m: least_of_legs(legs.length_m),
                universal_sine: legs.universal_sine(simd, joints),
                is_pivoted: !factorization.uses_blocks,
            }
        })
    }
}
