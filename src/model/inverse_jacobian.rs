//! Inverse Jacobian (paper, eq. 6-9).
//!
//! `J^-1` has the rows `[(b_i x n_i)^T  n_i^T]`, so `L' = J^-1 [omega; v]`. Its transpose
//! `N = [b x n; n]`, a column per leg, takes leg forces to the wrench on the platform about C:
//! `W = N Gamma`. The paper orders legs 6..1, this project 1..6.

use fearless_simd::dispatch;
use nalgebra::Matrix6;

use super::factorization::{Factorization, wrench_columns};
use super::inverse_geometry::LegGeometry;
use super::machine::{LEGS, Machine};
use super::rigid::{Pose, Twist};

/// N, 6 x 6: column i is the wrench on the platform of a unit force in leg i, torque rows first \[m\],
/// force rows below \[1\].
pub fn leg_wrenches(machine: &Machine, pose: &Pose) -> Matrix6<f64> {
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::new(simd, &machine.joints, pose);
        wrench_columns(&machine.joints.triples, &legs)
    })
}

/// 2-norm condition number of N, torques about the mean of the joints on the platform and in units of the
/// characteristic length, so that metres and radians compare and nothing depends on where C is. Infinite at a
/// singular pose. Not for the loop: it computes singular values.
pub fn condition(machine: &Machine, pose: &Pose) -> f64 {
    let singular_values = scaled_wrenches(machine, pose).singular_values();
    singular_values.max() / singular_values.min()
}

/// N as [`condition`] judges it.
pub fn scaled_wrenches(machine: &Machine, pose: &Pose) -> Matrix6<f64> {
    let mut scaled = dispatch!(machine.level, simd => {
        let legs = LegGeometry::around_center(simd, &machine.joints, pose);
        wrench_columns(&machine.joints.triples, &legs)
    });
    scaled.fixed_rows_mut::<3>(0).unscale_mut(machine.joints.radius);
    scaled
}

/// The twist that gives the measured leg rates: solves `J^-1 [omega; v] = L'`.
///
/// `None` at a singular pose. Errors of the rates are amplified by the condition of the pose.
pub fn twist_from_rates(machine: &Machine, pose: &Pose, rates: &[f64; LEGS]) -> Option<Twist> {
    let rates = machine.joints.triples.pack(rates);
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::new(simd, &machine.joints, pose);
        let twist = Factorization::new(simd, &machine.joints, &legs).twist(&legs, rates.load(simd));
        twist.map(|twist| twist.first())
    })
}
