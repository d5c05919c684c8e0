//! Weighted size of a disturbance, in which angular accelerations are those of a joint on the platform.

use nalgebra::{Matrix6, Vector6};

/// Least missing force as a ratio of the largest: twice the friction that a model leaves out.
pub(in crate::control) const LEAST_FORCE_RATIO: f64 = 0.06;

/// The least disturbance that may be a missing force, weighted as [`weighted`] does it; evaluated at home.
pub(in crate::control) fn least_disturbance(by_force: &Matrix6<f64>, arm: f64, max_force: f64) -> f64 {
    let columns = by_force.column_iter().map(|column| weighted(&column.into(), arm).norm());
    // Elsewhere a force may accelerate less.
    0.5 * LEAST_FORCE_RATIO * max_force * columns.fold(f64::INFINITY, f64::min)
}

/// Angular accelerations as those of a joint on the platform. Legs have no angles: `arm` is 1 for them.
pub(in crate::control) fn weighted(acceleration: &Vector6<f64>, arm: f64) -> Vector6<f64> {
    acceleration.component_mul(&Vector6::new(arm, arm, arm, 1.0, 1.0, 1.0))
}
