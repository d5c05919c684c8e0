//! Distributed clock of a simulated device.

/// Clock that runs fast or slow, the offset that the main device writes, and the loop that steers it to the reference clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalClock {
    /// Local time at instant 0 \[ns\].
    start_ns: i64,
    /// How much faster than true time, in millionths.
    drift_ppm: f64,
    /// Register 0x0920: local time to system time \[ns\].
    system_offset_ns: i64,
    /// What the loop has added until it steered last \[ns\].
    correction_ns: f64,
    /// What it adds to the rate.
    rate: f64,
    steered_ns: u64,
}

/// Share of a deviation that one datagram corrects. A real loop is slower.
const PHASE_GAIN: f64 = 1.0 / 8.0;
/// Change of the rate for a deviation \[1/ns\].
const RATE_GAIN: f64 = 1e-6 / 256.0;
/// Beyond this deviation \[ns\] the offset has not been written yet, and the loop does nothing.
const LOOP_RANGE_NS: i64 = 100_000_000;

impl LocalClock {
    /// A clock that nothing has steered yet.
    pub fn new(start_ns: i64, drift_ppm: f64) -> Self {
        Self { start_ns, drift_ppm, ..Self::default() }
    }

    /// Time of the device's oscillator at an instant \[ns\].
    pub fn local_ns(&self, now_ns: u64) -> u64 {
        let drift_ns = (now_ns as f64 * self.drift_ppm * 1e-6) as i64;
        now_ns.wrapping_add_signed(self.start_ns + drift_ns)
    }

    /// System time of the segment, as this device has it \[ns\].
    pub fn system_ns(&self, now_ns: u64) -> u64 {
        self.local_ns(now_ns)
            .wrapping_add_signed(self.system_offset_ns + self.added_ns(now_ns).round() as i64)
    }

    fn added_ns(&self, now_ns: u64) -> f64 {
        self.correction_ns + self.rate * now_ns.saturating_sub(self.steered_ns) as f64
    }

    /// Instant at which the clock will show a system time, if nothing steers it until then \[ns\].
    pub fn instant_of(&self, system_ns: u64, now_ns: u64) -> u64 {
        let ahead_ns = system_ns.wrapping_sub(self.system_ns(now_ns)) as i64;
        now_ns.saturating_add_signed(
            (ahead_ns as f64 / (1.0 + self.drift_ppm * 1e-6 + self.rate)).round() as i64
        )
    }

    /// Steers towards the reference clock's time; returns own minus reference \[ns\].
    pub fn steer(&mut self, reference_ns: u64, now_ns: u64) -> i64 {
        let difference_ns = self.system_ns(now_ns).wrapping_sub(reference_ns) as i64;
        if difference_ns.abs() < LOOP_RANGE_NS {
            self.correction_ns = self.added_ns(now_ns) - difference_ns as f64 * PHASE_GAIN;
            self.rate -= difference_ns as f64 * RATE_GAIN;
            self.steered_ns = now_ns;
        }
        difference_ns
    }

    /// Sets the offset; the loop begins again.
    pub fn set_offset(&mut self, offset_ns: i64) {
        (self.system_offset_ns, self.correction_ns, self.rate) = (offset_ns, 0.0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steered_clock_follows_the_reference() {
        let reference = LocalClock::new(7_000_000, 30.0);
        let mut clock = LocalClock::new(-4_000, -50.0);
        clock.set_offset(7_500_000);
        let mut difference_ns = i64::MAX;
        for cycle in 1..1000 {
            let now_ns = cycle * 1_000_000;
            difference_ns = clock.steer(reference.system_ns(now_ns), now_ns);
        }
        assert!(difference_ns.abs() < 5, "{difference_ns}");
        let at_ns = clock.instant_of(clock.system_ns(999_000_000) + 1_000_000, 999_000_000);
        assert!(at_ns.abs_diff(999_999_970) < 3, "the reference is fast: {at_ns}");
    }
}
