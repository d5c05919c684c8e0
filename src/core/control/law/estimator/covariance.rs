//! Error covariance of the estimate, the same for all axes, and the Kalman gains that follow from it.
//!
//! State of one axis, in units of the noise of a reading and of the period: `[e, T w, T^2 d] / sigma`. The
//! disturbance is a random walk: d' is white noise of intensity q.
//!
//! ```text
//! P(t + eta T) = F P F^T + Q       F = [1 eta eta^2/2; 0 1 eta; 0 0 1]
//! Q = (we T)^6 [eta^5/20 eta^4/8 eta^3/6; eta^4/8 eta^3/3 eta^2/2; eta^3/6 eta^2/2 eta]
//! we = (q / (sigma^2 T))^(1/6)     bandwidth of the filter
//! reading of e:  K = P h / (h^T P h + 1), P -= K h^T P       h = [1 0 0]; a reading of T w has its own noise
//! ```
//!
//! Source: Kalman (1960); Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and
//! Navigation", 6.2.3. One number, `we T`, decides the gains. In these units all numbers are within a few
//! powers of ten of 1, also at 20 kHz. The covariance follows the true intervals, so lost or late samples
//! change the gains correctly. With constant gains the estimate is unstable if half of a source's samples are
//! missing.

use serde::{Deserialize, Serialize};

/// Noise model that determines the gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseModel {
    /// Bandwidth of the filter, `we` \[rad/s\].
    pub bandwidth_rad_s: f64,
    /// Standard deviation of a rate reading over that of a length reading \[1/s\]; `None` if rates are not
    /// used.
    pub rate_noise_ratio: Option<f64>,
    /// Period of the loop \[s\].
    pub period_s: f64,
}

/// Covariance matrix of one axis, upper triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Covariance {
    ee: f64,
    ew: f64,
    ed: f64,
    ww: f64,
    wd: f64,
    dd: f64,
}

/// Kalman gains of one reading: for e \[1\], w \[1/T\] and d \[1/T^2\]; w and d are stored without their
/// units.
pub type KalmanGains = [f64; 3];

/// Relative change of a gain per update below which the covariance is steady.
const STEADY_CHANGE: f64 = 1e-13;
/// Largest number of updates until the covariance is steady.
const MAX_STEADY_UPDATES: u32 = 1_000_000;

impl NoiseModel {
    /// Steady covariance after a reading, for one reading per period, and the gains of the last value and
    /// rate reading.
    pub fn steady(&self) -> (Covariance, [KalmanGains; 2]) {
        let mut covariance = Covariance::default();
        let mut gains = [KalmanGains::default(); 2];
        for _ in 0..MAX_STEADY_UPDATES {
            let before = gains[0];
            covariance.advance(self, 1.0);
            gains[0] = covariance.correct_value();
            gains[1] = self
                .scaled_rate_variance()
                .map_or(KalmanGains::default(), |noise| covariance.correct_rate(noise));
            let [e, _, d] = gains[0];
            if (e - before[0]).abs() <= STEADY_CHANGE * e && (d - before[2]).abs() <= STEADY_CHANGE * d.abs()
            {
                break;
            }
        }
        (covariance, gains)
    }

    /// Variance of a rate reading, in the units of the state.
    pub(in crate::control::law::estimator) fn scaled_rate_variance(&self) -> Option<f64> {
        self.rate_noise_ratio.map(|ratio| (ratio * self.period_s) * (ratio * self.period_s))
    }
}

impl Covariance {
    /// Advances the covariance over a number of periods without a reading.
    pub fn advance(&mut self, model: &NoiseModel, period_count: f64) {
        let Self { ee, ew, ed, ww, wd, dd } = *self;
        let (n, half) = (period_count, 0.5 * period_count * period_count);
        let (by_e, by_w, by_d) = (ee + n * ew + half * ed, ew + n * ww + half * wd, ed + n * wd + half * dd);
        let (rate_by_w, rate_by_d) = (ww + n * wd, wd + n * dd);
        let third = (model.bandwidth_rad_s * model.period_s) * (model.bandwidth_rad_s * model.period_s);
        let intensity = third * third * third * n;
        let square = n * n;
        *self = Self {
            ee: by_e + n * by_w + half * by_d + intensity * square * square / 20.0,
            ew: by_w + n * by_d + intensity * square * n / 8.0,
            ed: by_d + intensity * square / 6.0,
            ww: rate_by_w + n * rate_by_d + intensity * square / 3.0,
            wd: rate_by_d + intensity * n / 2.0,
            dd: dd + intensity,
        };
    }

    /// Updates the covariance by a reading of e. Returns the gains.
    pub fn correct_value(&mut self) -> KalmanGains {
        let Self { ee, ew, ed, .. } = *self;
        let share = 1.0 / (ee + 1.0);
        self.correct([ee, ew, ed], share)
    }

    /// Updates the covariance by a reading of T w with this variance. Returns the gains.
    pub fn correct_rate(&mut self, noise: f64) -> KalmanGains {
        let Self { ew, ww, wd, .. } = *self;
        let share = 1.0 / (ww + noise);
        self.correct([ew, ww, wd], share)
    }

    fn correct(&mut self, [e, w, d]: [f64; 3], share: f64) -> KalmanGains {
        let gains = [e * share, w * share, d * share];
        let [by_e, by_w, by_d] = gains;
        self.ee -= by_e * e;
        self.ew -= by_e * w;
        self.ed -= by_e * d;
        self.ww -= by_w * w;
        self.wd -= by_w * d;
        self.dd -= by_d * d;
        gains
    }

    /// Variance of the innovation of e, relative to the variance of a reading.
    pub fn innovation_variance_ratio(&self) -> f64 {
        self.ee + 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(bandwidth_hz: f64, rate_noise_ratio: Option<f64>) -> NoiseModel {
        NoiseModel {
            bandwidth_rad_s: core::f64::consts::TAU * bandwidth_hz,
            rate_noise_ratio,
            period_s: 1e-3,
        }
    }

    /// A slow filter has `K ~ [2 we T, 2 (we T)^2, (we T)^3]`: the poles of Butterworth,
    /// `s^3 + 2 we s^2 + 2 we^2 s + we^3`.
    #[test]
    fn a_slow_filter_has_the_poles_of_butterworth() {
        for hertz in [0.1, 0.3, 1.0] {
            let x = core::f64::consts::TAU * hertz * 1e-3;
            let (_, [gains, _]) = model(hertz, None).steady();
            for (gain, expected) in gains.iter().zip([2.0 * x, 2.0 * x * x, x * x * x]) {
                assert!((gain / expected - 1.0).abs() < 2.5 * x, "{hertz}: {gains:?}");
            }
        }
    }

    /// Expected values: an independent solution of the Riccati equation.
    #[test]
    fn the_gains_are_those_of_the_riccati_equation() {
        for (hertz, expected) in [(30.0, [0.314, 0.0590, 0.00555]), (10.0, [0.118, 0.00742, 0.000233])] {
            let (covariance, [gains, _]) = model(hertz, None).steady();
            for (gain, expected) in gains.iter().zip(expected) {
                assert!((gain / expected - 1.0).abs() < 0.01, "{hertz}: {gains:?}");
            }
            let mut before = covariance;
            before.advance(&model(hertz, None), 1.0);
            if hertz == 30.0 {
                assert!((before.innovation_variance_ratio().sqrt() - 1.21).abs() < 0.005);
            }
        }
    }

    #[test]
    fn it_is_steady() {
        for rate_noise_ratio in [None, Some(10.0), Some(300.0)] {
            for hertz in [0.05, 1.0, 30.0, 200.0] {
                let model = model(hertz, rate_noise_ratio);
                let (covariance, [gains, _]) = model.steady();
                let mut next = covariance;
                next.advance(&model, 1.0);
                let again = next.correct_value();
                for (gain, again) in gains.iter().zip(again) {
                    assert!((gain / again - 1.0).abs() < 1e-9, "{hertz} Hz: {gains:?} {again:?}");
                }
            }
        }
    }

    /// Advancing by 0.3 and 0.7 of a period equals advancing by one period.
    #[test]
    fn pieces_of_a_period_are_the_period() {
        let model = model(30.0, None);
        let (start, _) = model.steady();
        let (mut whole, mut pieces) = (start, start);
        whole.advance(&model, 1.0);
        pieces.advance(&model, 0.3);
        pieces.advance(&model, 0.7);
        assert!((whole.ee - pieces.ee).abs() < 1e-15 && (whole.wd - pieces.wd).abs() < 1e-15);
        assert!((whole.dd / pieces.dd - 1.0).abs() < 1e-12);
    }
}
