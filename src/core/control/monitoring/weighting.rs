//! Weighted norm of a disturbance: an angular acceleration counts as the acceleration of a joint on the
//! platform.

use nalgebra::{Matrix6, Vector6};

/// Smallest missing force, relative to the largest force: twice the friction that a model leaves out.
pub(in crate::control) const MIN_MISSING_PER_MAX_FORCE: f64 = 0.06;

/// Smallest disturbance that may be a missing force, weighted by [`weighted`]; evaluated at home.
pub(in crate::control) fn least_missing_force_acceleration(
    by_force: &Matrix6<f64>,
    arm_m: f64,
    max_force_n: f64,
) -> f64 {
    let columns = by_force.column_iter().map(|column| weighted(&column.into(), arm_m).norm());
    // At other poses a force may accelerate the platform less, hence the factor one half.
    0.5 * MIN_MISSING_PER_MAX_FORCE * max_force_n * columns.fold(f64::INFINITY, f64::min)
}

/// Converts angular accelerations to accelerations of a joint on the platform. Legs have no angles: their
/// `arm_m` is 1.
pub(in crate::control) fn weighted(acceleration: &Vector6<f64>, arm_m: f64) -> Vector6<f64> {
    acceleration.component_mul(&Vector6::new(arm_m, arm_m, arm_m, 1.0, 1.0, 1.0))
}
