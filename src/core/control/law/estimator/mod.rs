//! Estimator: error of the platform, its rate, and the disturbance, at any instant near the present.
//!
//! It works in error coordinates, reference minus platform, so that the reference cancels. The coordinates
//! are the pose, or the leg lengths in modes on legs. u is the acceleration of the platform by the feedback
//! that was *sent*, after all limits ([`input_matrix`](super::input_matrix)). The disturbance d is the sum of
//! all accelerations that the model does not contain:
//!
//! ```text
//! e' = w,  w' = d - u,  d' = 0                       prediction, over intervals of constant u
//! nu = e_measured - e;   [e w d] += K nu             correction by a measurement, at its instant
//! ```
//!
//! K: see [`covariance`]. Rates correct the estimate as well, if the driver sends them and
//! `[measured] rate_noise_m_s` is set. The error at the instant at which a force begins is predicted from the
//! last measurement, with all accelerations sent since. A known dead time of the drives therefore costs no
//! stability, the prediction bridges lost samples, and sensor noise is filtered.
//!
//! The disturbance replaces the steady error that feedback would otherwise need against a payload, friction
//! or a process force. If it is compensated, its estimate is bounded
//! ([`EstimatorConstants::max_compensated_acceleration`]), so that the end of a long contact has an effect at once.
//! Sources: Luenberger (1971); Smith (1957) for the dead time.
//!
//! The model lacks elastic legs, drive lag other than a dead time, and coloured noise.

pub mod covariance;
mod sent_accelerations;

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::control::law::estimator::covariance::{Covariance, NoiseModel};
pub use crate::control::law::estimator::sent_accelerations::CAPACITY as SENT_ACCELERATIONS;
use crate::control::law::estimator::sent_accelerations::SentAccelerations;
use crate::control::signals::errors::{ErrorCoordinates, ErrorEstimate, FeedbackAcceleration};
use crate::control::signals::time::seconds_between;

impl ErrorEstimate {
    /// Adds gains times the innovation of a reading to the state.
    fn correct(
        &mut self,
        [by_e, by_w, by_d]: covariance::KalmanGains,
        rate_hz: f64,
        innovation: &Vector6<f64>,
    ) {
        self.value += innovation * by_e;
        self.rate += innovation * (by_w * rate_hz);
        self.disturbance_acceleration += innovation * (by_d * rate_hz * rate_hz);
    }
}

/// Kalman filter of six axes: estimate at the instant of the last measurement, or of the start if there was none since, and its
/// covariance.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct KalmanFilter {
    pub state: ErrorEstimate,
    pub time_ns: u64,
    covariance: Covariance,
}

impl KalmanFilter {
    pub fn new(constants: &EstimatorConstants, time_ns: u64, error: &ErrorCoordinates) -> Self {
        let ErrorCoordinates { value, rate } = *error;
        let state = ErrorEstimate { value, rate, disturbance_acceleration: Vector6::zeros() };
        Self { state, time_ns, covariance: constants.covariance }
    }

    /// Corrects the state, already predicted to the instant of the measurement. Returns the innovation.
    pub fn correct(
        &mut self,
        constants: &EstimatorConstants,
        time_ns: u64,
        measured: &ErrorCoordinates,
    ) -> Vector6<f64> {
        let EstimatorConstants { noise, max_compensated_acceleration, .. } = constants;
        let Self { state, covariance, .. } = self;
        let rate_hz = 1.0 / noise.period_s;
        covariance.advance(noise, seconds_between(self.time_ns, time_ns) * rate_hz);
        let innovation = measured.value - state.value;
        state.correct(covariance.correct_value(), rate_hz, &innovation);
        if let Some(variance) = noise.scaled_rate_variance() {
            let difference = (measured.rate - state.rate) * noise.period_s;
            state.correct(covariance.correct_rate(variance), rate_hz, &difference);
        }
        state.disturbance_acceleration = state
            .disturbance_acceleration
            .sup(&-max_compensated_acceleration)
            .inf(max_compensated_acceleration);
        self.time_ns = time_ns;
        innovation
    }
}

/// Estimator of the tracking error under control.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Estimator {
    filter: KalmanFilter,
    sent: SentAccelerations,
}

/// Constants of an estimator.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorConstants {
    /// Noise model that determines the gains.
    pub noise: NoiseModel,
    /// Initial covariance: the steady one.
    pub covariance: Covariance,
    /// Bound on the estimated disturbance of each axis: the largest that is compensated. Without compensation
    /// there is no bound; a bound would make the estimated error wrong by the excess.
    pub max_compensated_acceleration: Vector6<f64>,
    /// Noise and resolution of a length reading \[m\].
    pub reading_errors: ReadingErrors,
    /// Largest plausible acceleration of the platform that the model does not contain \[m/s^2\].
    pub max_plausible_acceleration_m_s2: f64,
}

/// Errors of the length readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadingErrors {
    /// Standard deviation of the noise \[m\].
    pub deviation_m: f64,
    /// Resolution \[m\]; 0 if unknown.
    pub resolution_or_0_m: f64,
}

/// Largest innovation by noise, in standard deviations; noise exceeds it once in years.
const NOISE_DEVIATIONS: f64 = 10.0;
/// Smallest bound on the innovation of a leg, whatever its noise \[m\]: friction, play and impacts reach it.
const MIN_INNOVATION_BOUND_M: f64 = 1e-4;

impl EstimatorConstants {
    /// Computes the constants; the initial covariance is the steady one of the noise model.
    pub fn new(
        noise: NoiseModel,
        reading_errors: ReadingErrors,
        max_compensated_acceleration: Vector6<f64>,
        max_plausible_acceleration_m_s2: f64,
    ) -> Self {
        Self {
            noise,
            covariance: noise.steady().0,
            max_compensated_acceleration,
            reading_errors,
            max_plausible_acceleration_m_s2,
        }
    }

    /// Largest plausible innovation of a leg, `dt_s` after the last measurement \[m\]: noise, plus the
    /// displacement by a disturbance that the estimate does not yet contain, `a (1 / we^2 + dt^2 / 2)`.
    pub fn innovation_bound_m(&self, dt_s: f64) -> f64 {
        let lag = 1.0 / self.noise.bandwidth_rad_s;
        MIN_INNOVATION_BOUND_M.max(NOISE_DEVIATIONS * self.reading_errors.deviation_m)
            + self.max_plausible_acceleration_m_s2 * (lag * lag + 0.5 * dt_s * dt_s)
    }
}

impl Estimator {
    /// Starts with an error at `begin_ns`, predicted from an earlier measurement. No acceleration has been
    /// sent. The disturbance starts at zero, because the payload may have changed.
    // Rarely called, hence out of line: the cycle stays short.
    #[inline(never)]
    pub fn start(
        &mut self,
        constants: &EstimatorConstants,
        measured_ns: u64,
        begin_ns: u64,
        error: &ErrorCoordinates,
    ) {
        let NoiseModel { period_s, .. } = constants.noise;
        self.filter = KalmanFilter::new(constants, begin_ns, error);
        self.filter.covariance.advance(&constants.noise, seconds_between(measured_ns, begin_ns) / period_s);
        self.sent.clear();
    }

    /// Corrects the estimate by the measured error at an instant, and by its rate if rates are used. Returns
    /// the innovation, measured minus predicted. A measurement that is not newer than the last has no effect.
    pub fn correct(
        &mut self,
        constants: &EstimatorConstants,
        time_ns: u64,
        measured: &ErrorCoordinates,
    ) -> Option<Vector6<f64>> {
        let Self { filter, sent } = self;
        if seconds_between(filter.time_ns, time_ns) <= 0.0 {
            return None;
        }
        sent.advance(&mut filter.state, filter.time_ns, time_ns);
        Some(filter.correct(constants, time_ns, measured))
    }

    /// Time from the last measurement, or from the start, to an instant \[s\].
    pub fn interval_s(&self, time_ns: u64) -> f64 {
        seconds_between(self.filter.time_ns, time_ns)
    }

    /// Estimate at the instant of the last measurement, or of the start.
    pub fn estimate_at_last_measurement(&self) -> &ErrorEstimate {
        &self.filter.state
    }

    /// Advances an estimate from that instant to a later one.
    pub fn predict(&self, state: &mut ErrorEstimate, instant_ns: u64) {
        self.sent.advance(state, self.filter.time_ns, instant_ns);
    }

    /// Records the feedback acceleration that is sent, after all limits, and the instant from which it acts.
    pub fn record_sent(&mut self, begin_ns: u64, acceleration: &FeedbackAcceleration) {
        self.sent.record(begin_ns, acceleration);
    }
}
