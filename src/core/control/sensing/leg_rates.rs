//! Estimated leg rates for drivers that send none, by the estimator of the control law without reference and
//! model.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::control::law::estimator::{EstimatorConstants, KalmanFilter};
use crate::control::signals::errors::{ErrorCoordinates, FeedbackAcceleration};
use crate::control::signals::inputs::Measurement;
use crate::control::signals::time::seconds_between;
use crate::model::LEGS;

/// Gap between two measurements \[s\] after which the estimate restarts at rest.
const MAX_GAP_S: f64 = 0.1;

/// Estimator of the leg rates. It assumes that the acceleration of a leg is constant.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct LegRateEstimator {
    filter: Option<KalmanFilter>,
}

impl LegRateEstimator {
    /// Leg rates at the instant of a measurement, measured or estimated \[m/s\].
    pub fn rates(&mut self, constants: &EstimatorConstants, measurement: &Measurement) -> [f64; LEGS] {
        measurement.rate_m_s.unwrap_or_else(|| self.estimated(constants, measurement))
    }

    #[inline(never)]
    fn estimated(&mut self, constants: &EstimatorConstants, measurement: &Measurement) -> [f64; LEGS] {
        let time_ns = measurement.time_ns;
        let measured =
            ErrorCoordinates { value: Vector6::from(measurement.length_m), rate: Vector6::zeros() };
        let elapsed_s = |filter: &KalmanFilter| seconds_between(filter.time_ns, time_ns);
        let filter = match &mut self.filter {
            Some(filter) if (0.0..MAX_GAP_S).contains(&elapsed_s(filter)) => filter,
            other => other.insert(KalmanFilter::new(constants, time_ns, &measured)),
        };
        let dt = elapsed_s(filter);
        if dt > 0.0 {
            filter.state.advance(dt, &FeedbackAcceleration::default());
            filter.correct(constants, time_ns, &measured);
        }
        filter.state.rate.into()
    }
}
