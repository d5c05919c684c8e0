//! Feedback accelerations that were sent recently. Each acts until the next one begins.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::control::signals::errors::{ErrorEstimate, FeedbackAcceleration};
use crate::control::signals::time::seconds_between;

/// Number of accelerations kept, a power of two. At 10 kHz they cover 25 ms, the longest delay of the drives
/// plus age of a measurement.
pub const CAPACITY: usize = 256;

const ZERO: FeedbackAcceleration = FeedbackAcceleration(Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0));

/// Acceleration, and the instant from which it acts.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct SentAcceleration {
    begin_ns: u64,
    acceleration: FeedbackAcceleration,
}

/// Ring buffer of the last accelerations.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control::law::estimator) struct SentAccelerations {
    #[serde(with = "serde_big_array::BigArray")]
    ring: [SentAcceleration; CAPACITY],
    /// Number of accelerations ever recorded; the last one has index `total_recorded - 1`.
    total_recorded: usize,
}

impl Default for SentAccelerations {
    fn default() -> Self {
        Self { ring: [SentAcceleration::default(); CAPACITY], total_recorded: 0 }
    }
}

impl SentAccelerations {
    /// Removes all accelerations. None acts until the next one is recorded and begins.
    pub fn clear(&mut self) {
        self.total_recorded = 0;
    }

    /// Records an acceleration that acts from an instant on.
    pub fn record(&mut self, begin_ns: u64, acceleration: &FeedbackAcceleration) {
        if let Some(slot) = self.ring.get_mut(self.total_recorded % CAPACITY) {
            *slot = SentAcceleration { begin_ns, acceleration: *acceleration };
        }
        self.total_recorded += 1;
    }

    /// Acceleration that was recorded `age` before the last one.
    fn recorded(&self, age: usize) -> Option<&SentAcceleration> {
        if age >= self.total_recorded.min(CAPACITY) {
            return None;
        }
        self.ring.get((self.total_recorded - 1 - age) % CAPACITY)
    }

    /// Advances an error estimate from one instant to a later one, under the accelerations that act in
    /// between.
    pub fn advance(&self, state: &mut ErrorEstimate, from_ns: u64, to_ns: u64) {
        let mut age = 0;
        while self.recorded(age).is_some_and(|sent| sent.begin_ns > from_ns) {
            age += 1;
        }
        let (mut acting, mut now_ns) = (self.recorded(age), from_ns);
        loop {
            let next = age.checked_sub(1).and_then(|age| Some((age, self.recorded(age)?)));
            let end_ns = next.map_or(to_ns, |(_, next)| next.begin_ns.min(to_ns));
            if end_ns > now_ns {
                // No acceleration acts before the first one begins.
                let acceleration = acting.map_or(&ZERO, |sent| &sent.acceleration);
                state.advance(seconds_between(now_ns, end_ns), acceleration);
                now_ns = end_ns;
            }
            match next {
                Some((next_age, next)) if end_ns < to_ns => (acting, age) = (Some(next), next_age),
                _ => return,
            }
        }
    }
}
