//! Test for rest of the platform by its lengths alone, for drivers that send no rates.
//!
//! A filter of rates lags: when the platform brakes, it still shows a velocity that is gone. Without measured
//! rates control therefore begins at rest only. The test fits straight lines to the lengths of a window, by
//! least squares:
//!
//! ```text
//! L_k = L_0 + L' t_k + scatter
//! deviation of L':  s / sqrt(sum (t_k - mean t)^2),  s^2 = sum scatter^2 / (n - 2)
//! the platform stands if  |speed of a joint by L'| + 5 deviations <= 1e-3 velocity limits
//! ```
//!
//! A motion that is no straight line (brakes, a fall, a step) makes the scatter large, and with it the
//! deviation. The window is as long as the stated noise requires, and at least long enough for a few times
//! the usual noise. A platform at rest is recognized after one window, or after two if it came to rest within
//! the first. It counts as standing while the lengths stay within the scatter of the last window.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use serde::{Deserialize, Serialize};

use crate::control::parameters::Parameters;
use crate::control::signals::inputs::Measurement;
use crate::control::signals::time::seconds_between;
use crate::model::LEGS;

/// Shortest window \[s\]. In it, noise of 2 um at 1 kHz gives the rate a deviation of 0.02 mm/s, and noise of
/// 10 um a deviation of 0.12 mm/s.
const MIN_WINDOW_S: f64 = 0.045;
/// Uncertainty of a rate, in standard deviations of the rate. With the stated noise the uncertainty may reach
/// the next share of the largest speed at rest.
const DEVIATIONS: f64 = 5.0;
const NOISE_SHARE: f64 = 0.5;
/// Least number of measurements in a window.
const MIN_COUNT: u32 = 8;
/// Change of a length that exceeds the scatter, in standard deviations of the scatter.
const SCATTER_DEVIATIONS: f64 = 10.0;

/// Speed of a joint at which a platform without force counts as standing, as a ratio of the velocity limit.
/// It is above the noise of rates, and small enough for feedback to take up at once.
const STANDING_RATIO: f64 = 1e-3;

/// Largest speed of a joint at which the platform counts as standing \[m/s\].
pub(in crate::control) fn max_standing_speed_m_s(parameters: &Parameters) -> f64 {
    STANDING_RATIO * parameters.unscaled_limits().position.velocity
}

/// Length of the window in which the rate is certain with the stated noise \[s\].
///
/// With n = T / period measurements, evenly spread, the deviation of the slope is `s sqrt(12 / n) / T`.
pub(in crate::control) fn window_s(parameters: &Parameters) -> f64 {
    let allowed = NOISE_SHARE * max_standing_speed_m_s(parameters) / DEVIATIONS;
    let needed = parameters.reading_errors.deviation_m * (12.0 * parameters.period_s()).sqrt() / allowed;
    libm::cbrt(needed * needed).max(MIN_WINDOW_S)
}

/// Leg rates over a window.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::control) struct WindowRates {
    /// Rate of each leg \[m/s\].
    pub rate_m_s: [f64; LEGS],
    /// Bound on the error of any leg's rate \[m/s\].
    pub uncertainty_m_s: f64,
    /// Largest standard deviation of the lengths from their lines \[m\].
    scatter: f64,
}

/// Sums for the lines through the lengths; times and lengths are relative to the first measurement.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Window {
    first_ns: u64,
    first: [f64; LEGS],
    last_s: f64,
    count: u32,
    t: f64,
    t_t: f64,
    l: [f64; LEGS],
    t_l: [f64; LEGS],
    l_l: [f64; LEGS],
}

impl Window {
    fn new(measurement: &Measurement) -> Self {
        let zeros = [0.0; LEGS];
        let (first_ns, first) = (measurement.time_ns, measurement.length_m);
        Self { first_ns, first, last_s: 0.0, count: 1, t: 0.0, t_t: 0.0, l: zeros, t_l: zeros, l_l: zeros }
    }

    fn add(&mut self, t: f64, away: &[f64; LEGS]) {
        (self.last_s, self.count) = (t, self.count + 1);
        self.t += t;
        self.t_t += t * t;
        for (((l, t_l), l_l), away) in self.l.iter_mut().zip(&mut self.t_l).zip(&mut self.l_l).zip(away) {
            *l += away;
            *t_l += t * away;
            *l_l += away * away;
        }
    }

    /// Slopes of the lines through the lengths; `None` if there are too few measurements.
    fn rates(&self) -> Option<WindowRates> {
        if self.count < MIN_COUNT {
            return None;
        }
        let n = f64::from(self.count);
        let spread = self.t_t - self.t * self.t / n;
        let (mut rate_m_s, mut most) = ([0.0; LEGS], 0.0_f64);
        let sums = self.l.iter().zip(&self.t_l).zip(&self.l_l);
        for (rate, ((l, t_l), l_l)) in rate_m_s.iter_mut().zip(sums) {
            let common = t_l - self.t * l / n;
            *rate = common / spread;
            most = most.max(l_l - l * l / n - *rate * common);
        }
        let scatter = (most / (n - 2.0)).sqrt();
        Some(WindowRates { rate_m_s, uncertainty_m_s: DEVIATIONS * scatter / spread.sqrt(), scatter })
    }
}

/// Test for rest by windows of the lengths without force.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct Standstill {
    window: Option<Window>,
    /// Rates of the last whole window, while the lengths stay within its scatter.
    rates: Option<WindowRates>,
}

impl Standstill {
    /// Adds a measurement, later than all before, to a window of length `window_s`.
    pub fn add(&mut self, parameters: &Parameters, window_s: f64, measurement: &Measurement) {
        let Some(window) = &mut self.window else {
            self.window = Some(Window::new(measurement));
            return;
        };
        let t = seconds_between(window.first_ns, measurement.time_ns);
        let mut away = measurement.length_m;
        away.iter_mut().zip(&window.first).for_each(|(length, first)| *length -= first);
        window.add(t, &away);
        let moved = away.iter().fold(0.0_f64, |most, away| most.max(away.abs()));
        if self.rates.is_some_and(|rates| {
            moved
                > SCATTER_DEVIATIONS * rates.scatter
                    + max_standing_speed_m_s(parameters) * t
                    + parameters.reading_errors.resolution_or_0_m
        }) {
            (self.window, self.rates) = (Some(Window::new(measurement)), None);
        } else if t >= window_s {
            (self.rates, self.window) = (window.rates(), Some(Window::new(measurement)));
        }
    }

    /// Rates of the last whole window, if the lengths stay within its scatter.
    pub fn rates(&self) -> Option<WindowRates> {
        self.rates
    }

    /// Rates of the last whole window, else of the present window, which is not whole.
    pub fn latest(&self) -> Option<WindowRates> {
        self.rates.or_else(|| self.window.and_then(|window| window.rates()))
    }
}
