//! Estimator: error of the platform, its rate, and the disturbance, at any instant near now.
//!
//! It works in error coordinates, reference minus platform, of the pose or in modes on legs of their lengths. There the
//! reference cancels. With u the acceleration of the platform by what feedback has *sent*, after all limits
//! ([`input_matrix`](super::input_matrix)), and d the disturbance, the sum of all
//! accelerations that the model does not contain:
//!
//! ```text
//! e' = w,  w' = d - u,  d' = 0                       prediction, between pieces of constant u
//! nu = e_measured - e;   [e w d] += K nu             correction by a measurement, at its instant
//! ```
//!
//! K: see [`covariance`]. Rates are measured too if the driver sends them and `[measured] rate_noise_m_s` says how good they
//! are. The error at the instant at which a force begins is the prediction from the last measurement to there, over all that
//! was sent meanwhile. So a dead time of the drives that is known costs no stability, a lost sample is bridged, and noise of the
//! sensors is filtered.
//!
//! The disturbance takes what feedback would otherwise need an error for: a payload, friction, a force of the process. Where it
//! is compensated it stays within [`Law::max_compensated`](super::Law), so that a long contact is forgotten at once. Source of the structure: Luenberger (1971), Smith (1957) for the dead time.
//!
//! What it does not know: elastic legs, the lag of drives but as a dead time, and coloured noise.

pub mod covariance;
mod sent_accelerations;

use nalgebra::Vector6;

use crate::control::law::estimator::covariance::{Covariance, NoiseModel};
pub use crate::control::law::estimator::sent_accelerations::CAPACITY as SENT_ACCELERATIONS;
use crate::control::law::estimator::sent_accelerations::SentAccelerations;
use crate::control::signals::errors::ErrorCoordinates;
use crate::control::signals::errors::ErrorEstimate;
use crate::control::signals::time::seconds_between;

impl ErrorEstimate {
    /// Corrects it by gains times differences of a reading from the prediction.
    fn correct(
        &mut self,
        [by_e, by_w, by_d]: covariance::KalmanGains,
        rate_hz: f64,
        innovation: &Vector6<f64>,
    ) {
        self.value += innovation * by_e;
        self.rate += innovation * (by_w * rate_hz);
        self.disturbance += innovation * (by_d * rate_hz * rate_hz);
    }
}

/// Filter of six axes: the estimate at the instant of the last measurement, and how certain it is.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::control) struct Filter {
    pub state: ErrorEstimate,
    pub time_ns: u64,
    covariance: Covariance,
}

impl Filter {
    pub fn new(constants: &EstimatorConstants, time_ns: u64, error: &ErrorCoordinates) -> Self {
        let ErrorCoordinates { value, rate } = *error;
        let state = ErrorEstimate { value, rate, disturbance: Vector6::zeros() };
        Self { state, time_ns, covariance: constants.covariance }
    }

    /// Corrects a state, which is predicted for the instant of a measurement. Returns the innovation.
    pub fn correct(
        &mut self,
        constants: &EstimatorConstants,
        time_ns: u64,
        measured: &ErrorCoordinates,
    ) -> Vector6<f64> {
        let EstimatorConstants { noise, max_compensated, .. } = constants;
        let Self { state, covariance, .. } = self;
        let rate_hz = 1.0 / noise.period_s;
        covariance.advance(noise, seconds_between(self.time_ns, time_ns) * rate_hz);
        let innovation = measured.value - state.value;
        state.correct(covariance.correct_value(), rate_hz, &innovation);
        if let Some(variance) = noise.rate_noise() {
            let difference = (measured.rate - state.rate) * noise.period_s;
            state.correct(covariance.correct_rate(variance), rate_hz, &difference);
        }
        state.disturbance = state.disturbance.sup(&-max_compensated).inf(max_compensated);
        self.time_ns = time_ns;
        innovation
    }
}

/// Estimator of the error under control.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimator {
    filter: Filter,
    sent: SentAccelerations,
}

/// The constants of an estimator.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorConstants {
    /// What the gains follow from.
    pub noise: NoiseModel,
    /// At first.
    pub covariance: Covariance,
    /// Largest estimate of the disturbance of each axis: what is compensated at most. Without compensation it has no bound, or
    /// the estimated error would be wrong by what is beyond.
    pub max_compensated: Vector6<f64>,
    /// Noise of a reading of a length, and its resolution \[m\].
    pub reading_errors: ReadingErrors,
    /// Largest plausible acceleration of the platform that the model does not contain \[m/s^2\].
    pub largest_disturbance: f64,
}

/// Errors of the readings of lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadingErrors {
    /// Standard deviation \[m\].
    pub deviation: f64,
    /// Resolution \[m\]; 0 if it is not known.
    pub resolution: f64,
}

/// Innovations beyond the disturbance that are noise, over its standard deviation: once in years.
const NOISE_DEVIATIONS: f64 = 10.0;
/// Innovation of a leg that is plausible whatever its noise \[m\]: of friction, play and impacts.
const MIN_INNOVATION_BOUND_M: f64 = 1e-4;

impl EstimatorConstants {
    /// Evaluates them.
    pub fn new(
        noise: NoiseModel,
        reading_errors: ReadingErrors,
        max_compensated: Vector6<f64>,
        largest_disturbance: f64,
    ) -> Self {
        Self { noise, covariance: noise.steady().0, max_compensated, reading_errors, largest_disturbance }
    }

    /// Largest plausible innovation of a leg, `dt` after the last measurement \[m\]: noise, and the way of a disturbance that the
    /// estimate does not know yet, `a (1 / we^2 + dt^2 / 2)`.
    pub fn innovation_bound(&self, dt: f64) -> f64 {
        let lag = 1.0 / self.noise.bandwidth;
        MIN_INNOVATION_BOUND_M.max(NOISE_DEVIATIONS * self.reading_errors.deviation)
            + self.largest_disturbance * (lag * lag + 0.5 * dt * dt)
    }
}

impl Estimator {
    /// Begins with an error at an instant, predicted from a measurement before it; nothing was sent, and the disturbance is
    /// unknown: the payload may be another.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    pub fn start(
        &mut self,
        constants: &EstimatorConstants,
        measured_ns: u64,
        begin_ns: u64,
        error: &ErrorCoordinates,
    ) {
        let NoiseModel { period_s, .. } = constants.noise;
        self.filter = Filter::new(constants, begin_ns, error);
        self.filter.covariance.advance(&constants.noise, seconds_between(measured_ns, begin_ns) / period_s);
        self.sent.clear();
    }

    /// Corrects the estimate by the measured error at an instant; rates where they are used. Returns the innovation: measured
    /// minus predicted. A measurement that is not newer changes nothing.
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

    /// Time since the last measurement \[s\].
    pub fn interval_s(&self, time_ns: u64) -> f64 {
        seconds_between(self.filter.time_ns, time_ns)
    }

    /// The estimate at the instant of the last measurement.
    pub fn state(&self) -> &ErrorEstimate {
        &self.filter.state
    }

    /// Moves the estimate from the instant of the last measurement to a later one.
    pub fn predict(&self, state: &mut ErrorEstimate, instant_ns: u64) {
        self.sent.advance(state, self.filter.time_ns, instant_ns);
    }

    /// Records the acceleration that feedback sends, after all limits, and the instant from which on it acts.
    pub fn record_sent(&mut self, begin_ns: u64, acceleration: &Vector6<f64>) {
        self.sent.record(begin_ns, acceleration);
    }
}
