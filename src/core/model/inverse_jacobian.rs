//! Inverse Jacobian (paper, eq. 6-9).
//!
//! `J^-1` has the rows `[(b_i x n_i)^T  n_i^T]`, so `L' = J^-1 [omega; v]`. Its transpose `N = [b x n; n]`,
//! one column per leg, takes leg forces to the wrench on the platform about C: `W = N Gamma`. The paper
//! orders legs 6..1, this project 1..6.

use fearless_simd::dispatch;
use nalgebra::Matrix6;

use super::LEGS;
use super::factorization::{Factorization, wrench_columns};
use super::inverse_geometry::LegGeometry;
use super::machine::Machine;
use super::rigid::{Pose, Twist};

/// Matrix N, 6 x 6. Column i is the wrench on the platform of a unit force in leg i: torque rows first \[m\],
/// then force rows \[1\].
///
/// ```
/// use hexad_core::model::{inverse_jacobian::{leg_wrenches, twist_from_rates}, rigid::Twist};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let (pose, twist) = (machine.home_pose(), Twist { linear: [0.0, 0.1, 0.2].into(), ..Twist::default() });
/// // Its transpose takes a twist to leg rates, and twist_from_rates takes them back.
/// let rates = leg_wrenches(&machine, &pose).tr_mul(&twist.vector());
/// let found = twist_from_rates(&machine, &pose, &rates.into()).unwrap();
/// assert!((found.vector() - twist.vector()).amax() < 1e-14);
/// ```
pub fn leg_wrenches(machine: &Machine, pose: &Pose) -> Matrix6<f64> {
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::new(simd, &machine.joints, pose);
        wrench_columns(&machine.joints.triples, &legs)
    })
}

/// Condition number of N in the 2-norm. Torques are taken about the mean of the joints on the platform and in
/// units of the characteristic length, so that metres and radians are comparable and the choice of C has no
/// effect. Infinite at a singular pose. Not for the loop: it computes singular values.
pub fn condition(machine: &Machine, pose: &Pose) -> f64 {
    let singular_values = scaled_wrenches(machine, pose).singular_values();
    singular_values.max() / singular_values.min()
}

/// N with torques about the mean of the joints, divided by the radius: the matrix of [`condition`].
pub fn scaled_wrenches(machine: &Machine, pose: &Pose) -> Matrix6<f64> {
    let mut scaled = dispatch!(machine.level, simd => {
        let legs = LegGeometry::around_center(simd, &machine.joints, pose);
        wrench_columns(&machine.joints.triples, &legs)
    });
    scaled.fixed_rows_mut::<3>(0).unscale_mut(machine.joints.radius_m);
    scaled
}

/// Twist of the platform for measured leg rates: solves `J^-1 [omega; v] = L'`.
///
/// `None` at a singular pose. The condition of the pose amplifies errors of the rates.
pub fn twist_from_rates(machine: &Machine, pose: &Pose, rates_m_s: &[f64; LEGS]) -> Option<Twist> {
    let rates = machine.joints.triples.pack(rates_m_s);
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::new(simd, &machine.joints, pose);
        let twist = Factorization::new(simd, &machine.joints, &legs).twist(&legs, rates.load(simd));
        twist.map(|twist| twist.first())
    })
}
