//! What the law answers a first measured error with.

use hexad::config::Config;
use hexad::control::law::input_matrix::InputMatrix;
use hexad::control::signals::errors::{ErrorEstimate, FeedbackAcceleration};
use nalgebra::Vector6;

use hexad_support::rig::parameters;

/// Acceleration that the law answers a first measured error with, after rest without one: the gains of the estimator, its
/// prediction to the force 0.6 periods after the measurement, and the law.
pub fn answer(config: &Config, error: &Vector6<f64>) -> Vector6<f64> {
    let parameters = parameters(config);
    let (_, [[by_e, by_w, by_d], _]) = parameters.noise.steady();
    let period_s = parameters.noise.period_s;
    let input_matrix = InputMatrix::at_home(
        &config.machine,
        parameters.law.mode,
        &parameters.law.leg_masses,
        parameters.fidelity,
    );
    let largest = input_matrix.largest_compensable_disturbance(&parameters.law.max_compensated_acceleration);
    let estimate = ErrorEstimate {
        value: error * by_e,
        rate: error * (by_w / period_s),
        disturbance_acceleration: (error * (by_d / (period_s * period_s))).sup(&-largest).inf(&largest),
    };
    let at_force = estimate.after(0.6 * period_s, &FeedbackAcceleration::default());
    parameters.law.commanded_acceleration(&at_force, &input_matrix).0
}
