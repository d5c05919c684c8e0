//! Timing of a stream of samples, estimated from stamps and arrivals, and the delay that follows from it.

use serde::{Deserialize, Serialize};

use crate::control::signals::time::seconds_between;

/// Largest delay \[s\]: the delay of a 15 Hz source, half the slowest rate provided for. Slower sources are
/// extrapolated.
const MAX_DELAY_S: f64 = 0.15;
/// Largest change of the delay per time. It changes the twist of the target by the same ratio.
const MAX_DELAY_RATE: f64 = 0.1;
/// Time in which the delay moves to its estimate, from each new sample on \[s\]: many samples, so that noise of the estimate causes no
/// motion.
const DELAY_TRANSITION_S: f64 = 0.5;
/// Weight of the newest sample in the estimates of interval and jitter: an average over half a second at
/// 60 Hz.
const ESTIMATION_GAIN: f64 = 1.0 / 32.0;
/// Largest deviation that counts as jitter, as a ratio of the interval: lost samples are no jitter.
const MAX_JITTER_RATIO: f64 = 0.5;
/// Jitter as a multiple of its mean deviation. The mean deviation is a third of the jitter for intervals
/// between evenly distributed stamps, and a quarter for evenly distributed arrivals. Lost samples enlarge
/// both, so that less than 3 is enough.
const JITTER_PER_DEVIATION: f64 = 2.25;

/// Estimates of the stream's timing \[s\].
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::setpoint::pose_samples) struct SampleTiming {
    /// Number of intervals seen, up to the length of the average.
    pub interval_count: f64,
    pub interval_s: f64,
    /// Mean age of the newest sample when the next one arrives.
    age: f64,
    /// Mean deviation of that age.
    deviation: f64,
    /// The previous two intervals and ages.
    before: [[f64; 2]; 2],
}

impl SampleTiming {
    pub fn update(&mut self, interval_s: f64, age_s: f64) {
        if self.interval_count == 0.0 {
            (self.interval_s, self.age, self.before) = (interval_s, age_s, [[interval_s, age_s]; 2]);
        }
        self.interval_count = (self.interval_count + 1.0).min(1.0 / ESTIMATION_GAIN);
        let gain = 1.0 / self.interval_count;
        let deviation = (age_s - self.age).abs().min(MAX_JITTER_RATIO * self.interval_s);
        self.deviation += gain * (deviation - self.deviation);
        // Medians of three: a single lost sample changes no estimate, and a new rate changes it at once.
        let [[interval_2, age_2], [interval_1, age_1]] = self.before;
        self.interval_s += gain * (median(interval_2, interval_1, interval_s) - self.interval_s);
        self.age += gain * (median(age_2, age_1, age_s) - self.age);
        self.before = [[interval_1, age_1], [interval_s, age_s]];
    }

    /// Delay \[s\] at which the samples around an instant, and the one after, have nearly always arrived.
    pub fn interpolation_delay_s(&self) -> f64 {
        (self.interval_s + self.age + JITTER_PER_DEVIATION * self.deviation).clamp(0.0, MAX_DELAY_S)
    }
}

/// Delay of the target \[s\]; between two samples it changes at a constant rate.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::setpoint::pose_samples) struct TargetLag {
    since_ns: u64,
    value: f64,
    rate: f64,
}

impl TargetLag {
    pub fn new(value_s: f64, since_ns: u64) -> Self {
        Self { since_ns, value: value_s, rate: 0.0 }
    }

    pub fn at(&self, instant_ns: u64) -> f64 {
        self.value + self.rate * seconds_between(self.since_ns, instant_ns).clamp(0.0, DELAY_TRANSITION_S)
    }

    pub fn rate_at(&self, instant_ns: u64) -> f64 {
        if seconds_between(self.since_ns, instant_ns) < DELAY_TRANSITION_S { self.rate } else { 0.0 }
    }

    /// Delay that moves from its present value toward `goal_s`.
    pub fn toward(&self, goal_s: f64, now_ns: u64) -> Self {
        let value = self.at(now_ns);
        let rate = ((goal_s - value) / DELAY_TRANSITION_S).clamp(-MAX_DELAY_RATE, MAX_DELAY_RATE);
        Self { since_ns: now_ns, value, rate }
    }
}

fn median(a: f64, b: f64, c: f64) -> f64 {
    a.min(b).max(a.max(b).min(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn the_delay_changes_by_a_tenth_of_the_time_at_most_and_never_jumps() {
        for (from, to, after_ms, expected) in
            [(0.02, 0.15, 100, 0.03), (0.15, 0.02, 100, 0.14), (0.02, 0.03, 250, 0.025)]
        {
            let delay = TargetLag::new(from, 5 * MS).toward(to, 7 * MS);
            assert_eq!(delay.at(7 * MS), from);
            assert!((delay.at((7 + after_ms) * MS) - expected).abs() < 1e-12, "{delay:?}");
            assert!((delay.rate_at(8 * MS) * after_ms as f64 * 1e-3 - (expected - from)).abs() < 1e-12);
            // The delay does not pass its goal without new samples.
            assert!(
                (delay.at(90_000 * MS) - to).abs() <= (from - to).abs() && delay.rate_at(90_000 * MS) == 0.0
            );
            assert_eq!(delay.toward(0.07, 400 * MS).at(400 * MS), delay.at(400 * MS));
        }
    }
}
