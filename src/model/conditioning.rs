//! Conditioning of a pose: what proofs about the poses around it begin with. Of a [kinematic state](super::kinematic_state) only the
//! numbers, without the factorization behind them.

use fearless_simd::dispatch;

use super::factorization::Factorization;
use super::inverse_geometry::LegGeometry;
use super::lanes::least_of_legs;
use super::machine::Machine;
use super::rigid::Pose;
use super::sensitivity::Sensitivity;

/// Conditioning of a pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditioning {
    /// Condition and norm of N.
    pub sensitivity: Sensitivity,
    /// Length of the shortest leg \[m\].
    pub shortest: f64,
    /// See [`super::inverse_geometry::universal_sine`].
    pub universal_sine: f64,
    /// Whether the blocks of the factorization are too near to singular, so that it was LU with pivoting instead.
    pub is_pivoted: bool,
}

impl Conditioning {
    /// That of a machine at a pose.
    pub fn new(machine: &Machine, pose: &Pose) -> Self {
        let joints = &machine.joints;
        dispatch!(machine.level, simd => {
            let legs = LegGeometry::around_center(simd, joints, pose);
            let factorization = Factorization::new(simd, joints, &legs);
            Self {
                sensitivity: Sensitivity::new(simd, joints, &legs, &factorization),
                shortest: least_of_legs(legs.length),
                universal_sine: legs.universal_sine(simd, joints),
                is_pivoted: !factorization.uses_blocks,
            }
        })
    }
}
