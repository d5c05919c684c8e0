//! The grid of SYNC0 in the time of this computer.
//!
//! Each exchange gives the time since SYNC0 at the reference clock, with the jitter of the frame. A filter of second order
//! follows phase and rate: a clock that is steadily fast or slow leaves no error.

/// Exchanges after which the gains are constant; before, the phase is the mean.
const STARTING_EXCHANGES: u32 = 32;
/// Share of a deviation that corrects the phase at once.
const PHASE_GAIN: f64 = 1.0 / 32.0;
/// Share of a deviation that corrects the rate, per period: critically damped with the gain of the phase.
const RATE_GAIN: f64 = PHASE_GAIN * PHASE_GAIN / 4.0;
/// Largest deviation that counts, once started \[ns\]: a larger one is a frame that the host delayed.
const MAX_DEVIATION_NS: f64 = 10_000.0;

/// Filtered instants of SYNC0. Each pulse has a number, the system time of the segment in periods: a frame whose response the
/// host delays by periods still belongs to the right pulse.
#[derive(Clone, Copy, Debug)]
pub struct SyncClock {
    period_ns: u64,
    /// Number of the latest pulse.
    number: u64,
    /// Its instant: whole nanoseconds, and the rest.
    sync0_ns: u64,
    fraction_ns: f64,
    /// Deviation of the period, as a share.
    rate: f64,
    exchanges: u32,
}

impl SyncClock {
    /// A grid that is not yet known.
    pub fn new(period_ns: u64, now_ns: u64) -> Self {
        Self { period_ns, number: 0, sync0_ns: now_ns, fraction_ns: 0.0, rate: 0.0, exchanges: 0 }
    }

    /// The latest SYNC0 of the grid \[ns\].
    pub fn sync0_ns(&self) -> u64 {
        self.sync0_ns
    }

    /// The SYNC0 after it \[ns\].
    pub fn next_sync0_ns(&self) -> u64 {
        self.sync0_ns.saturating_add((self.fraction_ns + self.actual_period_ns()) as u64)
    }

    fn actual_period_ns(&self) -> f64 {
        self.period_ns as f64 * (1.0 + self.rate)
    }

    /// Goes on to the latest SYNC0 that is not after an instant.
    pub fn advance_to(&mut self, now_ns: u64) {
        let passed_ns = now_ns.saturating_sub(self.sync0_ns) as f64 - self.fraction_ns;
        let periods = (passed_ns / self.actual_period_ns()).floor().max(0.0);
        self.number += periods as u64;
        self.add(periods * self.actual_period_ns());
    }

    fn add(&mut self, step_ns: f64) {
        let sum_ns = self.fraction_ns + step_ns;
        let whole_ns = sum_ns.floor();
        self.sync0_ns = self.sync0_ns.saturating_add_signed(whole_ns as i64);
        self.fraction_ns = sum_ns - whole_ns;
    }

    /// Takes in that a frame was at the reference clock at about an instant, when this clock showed `system_ns`, and goes to the
    /// SYNC0 before that; the time since \[ns\].
    pub fn update(&mut self, frame_ns: u64, system_ns: u64) -> u64 {
        let (number, since_ns) = (system_ns / self.period_ns, system_ns % self.period_ns);
        let measured_ns = frame_ns.saturating_sub(since_ns);
        self.exchanges = self.exchanges.saturating_add(1);
        if self.exchanges == 1 {
            (self.sync0_ns, self.fraction_ns) = (measured_ns, 0.0);
        } else {
            let periods = number.wrapping_sub(self.number) as i64;
            self.add(periods as f64 * self.actual_period_ns());
            let deviation_ns = measured_ns.wrapping_sub(self.sync0_ns) as i64 as f64 - self.fraction_ns;
            if self.exchanges <= STARTING_EXCHANGES {
                self.add(deviation_ns / f64::from(self.exchanges));
            } else {
                let counted_ns = deviation_ns.clamp(-MAX_DEVIATION_NS, MAX_DEVIATION_NS);
                self.add(counted_ns * PHASE_GAIN);
                self.rate += counted_ns * RATE_GAIN / self.period_ns as f64;
            }
        }
        self.number = number;
        since_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest error of the grid \[ns\], for a reference clock that is fast by `ppm`, and frames whose responses are late by up to
    /// `jitter_ns`, and by `late_ns` in each hundredth cycle.
    fn error_ns(ppm: f64, jitter_ns: u64, late_ns: u64) -> f64 {
        let period_ns = 1_000_000.0 / (1.0 + ppm * 1e-6);
        let start_ns = 1_000_000_000_000u64;
        let mut clock = SyncClock::new(1_000_000, start_ns);
        let (mut random, mut error) = (1u64, 0.0f64);
        for cycle in 1..20_000u64 {
            let sync0_ns = start_ns as f64 + 345_678.0 + cycle as f64 * period_ns;
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let jitter_ns = (random >> 33) % (jitter_ns + 1);
            let late_ns = if cycle % 100 == 0 { late_ns } else { 0 };
            let frame_ns = sync0_ns as u64 + 100_000 + jitter_ns + late_ns;
            let since_ns = clock.update(frame_ns, (7_000 + cycle) * 1_000_000 + 100_000);
            assert_eq!(since_ns, 100_000);
            if cycle > 10_000 {
                error = error.max((clock.sync0_ns() as f64 - sync0_ns - jitter_ns as f64 / 2.0).abs());
            }
        }
        error
    }

    #[test]
    fn the_grid_follows_a_clock_that_is_fast_or_slow() {
        for ppm in [-50.0, 0.0, 50.0] {
            let error = error_ns(ppm, 0, 0);
            assert!(error < 100.0, "{ppm} ppm: {error} ns");
        }
    }

    #[test]
    fn jitter_is_filtered_and_late_responses_hardly_count() {
        for late_ns in [400_000, 1_700_000, 30_000_000] {
            let error = error_ns(20.0, 10_000, late_ns);
            assert!(error < 7_000.0, "{late_ns}: {error} ns");
        }
    }

    #[test]
    fn the_next_sync0_is_a_period_ahead() {
        let mut clock = SyncClock::new(1_000_000, 5_000_000);
        clock.advance_to(7_999_999);
        assert_eq!((clock.sync0_ns(), clock.next_sync0_ns()), (7_000_000, 8_000_000));
    }
}
