//! Longest known delay with which a sampled loop is stable. A delay is known if the estimator predicts over it, such as
//! the age of a measurement, given by its time stamp.

use super::sampled_loop::SampledLoop;

/// Longest known delay that is computed with the true period, and the resolution, in periods. The cost grows with the
/// third power of the delay.
const KNOWN_DELAY_PERIODS: f64 = 16.0;
const KNOWN_DELAY_STEP: f64 = 0.01;
/// Longest period in the search for the longest known delay, in true periods: more than a second at 20 kHz.
const MAX_COARSE_PERIODS: f64 = 1024.0;

impl SampledLoop {
    /// The longest known delay, in periods, with which the loop is stable for each of `masses`, as ratios of the
    /// modelled mass. The unknown part of the delay stays as it is. A delay beyond `KNOWN_DELAY_PERIODS` is computed
    /// for a loop with longer periods; the true loop is stable with a longer one.
    pub fn longest_known_delay_periods(&self, masses: &[f64]) -> f64 {
        let mut periods = 1.0;
        loop {
            let delay = self.coarse_known_delay(periods, masses);
            if delay < KNOWN_DELAY_PERIODS || periods > MAX_COARSE_PERIODS {
                return delay * periods;
            }
            periods *= 2.0;
        }
    }

    /// Whether the loop is stable with a known delay, in periods, for each of `masses`. A long delay is computed for a
    /// loop with longer periods. Much faster than [`SampledLoop::longest_known_delay_periods`].
    pub fn is_stable_with_known_delay(&self, delay: f64, masses: &[f64]) -> bool {
        let mut periods = 1.0;
        while delay / periods > KNOWN_DELAY_PERIODS {
            periods *= 2.0;
        }
        self.is_stable_with_coarse(periods, delay / periods, masses)
    }

    /// Whether a loop with `periods` times the true period is stable with a known delay, in its own periods.
    fn is_stable_with_coarse(&self, periods: f64, known_delay_periods: f64, masses: &[f64]) -> bool {
        let unknown = (self.delay_periods - self.known_delay_periods) / periods;
        let rate_noise_ratio = self.rate_noise_ratio.map(|noise| noise * periods);
        let wn_t = self.wn_t * periods;
        let held_pole_t = self.held_pole_t * periods;
        let late = Self {
            wn_t,
            rate_noise_ratio,
            held_pole_t,
            known_delay_periods,
            delay_periods: known_delay_periods + unknown,
            ..*self
        };
        masses.iter().all(|mass| late.is_stable_with_gain(1.0 / mass))
    }

    /// The longest known delay of a loop with `periods` times the true period, in its own periods.
    fn coarse_known_delay(&self, periods: f64, masses: &[f64]) -> f64 {
        let with = |known_delay: f64| self.is_stable_with_coarse(periods, known_delay, masses);
        if with(KNOWN_DELAY_PERIODS) {
            return KNOWN_DELAY_PERIODS;
        }
        let (mut inside, mut step) = (0.0, 0.5 * KNOWN_DELAY_PERIODS);
        while step > KNOWN_DELAY_STEP {
            inside += if with(inside + step) { step } else { 0.0 };
            step *= 0.5;
        }
        inside
    }
}
