//! The accelerations that feedback has sent lately, each until the next begins.

use nalgebra::Vector6;

use super::ErrorState;
use crate::control::input_validation::seconds_between;

/// Accelerations kept, a power of two: at 10 kHz those of 25 ms, the longest delay of the drives with the age of a measurement.
pub const CAPACITY: usize = 256;

/// An acceleration and the instant from which on it acts.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
struct SentAcceleration {
    begin_ns: u64,
    acceleration: Vector6<f64>,
}

/// Ring of the last accelerations.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct SentAccelerations {
    #[cfg_attr(feature = "daemon", serde(with = "serde_big_array::BigArray"))]
    ring: [SentAcceleration; CAPACITY],
    /// Number ever recorded; the last has the index of this less one.
    count: usize,
}

impl Default for SentAccelerations {
    fn default() -> Self {
        Self { ring: [SentAcceleration::default(); CAPACITY], count: 0 }
    }
}

impl SentAccelerations {
    /// Forgets all: until the next one acts there is none.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Records an acceleration that acts from an instant on.
    pub fn record(&mut self, begin_ns: u64, acceleration: &Vector6<f64>) {
        if let Some(slot) = self.ring.get_mut(self.count % CAPACITY) {
            *slot = SentAcceleration { begin_ns, acceleration: *acceleration };
        }
        self.count += 1;
    }

    /// The one recorded so many before the last.
    fn recorded(&self, age: usize) -> Option<&SentAcceleration> {
        if age >= self.count.min(CAPACITY) {
            return None;
        }
        self.ring.get((self.count - 1 - age) % CAPACITY)
    }

    /// Moves an error from an instant to a later one, under the accelerations that act between them.
    pub fn advance(&self, state: &mut ErrorState, from_ns: u64, to_ns: u64) {
        let mut age = 0;
        while self.recorded(age).is_some_and(|sent| seconds_between(sent.begin_ns, from_ns) < 0.0) {
            age += 1;
        }
        let mut now_ns = from_ns;
        loop {
            // Before the first none acts.
            let acceleration = self.recorded(age).map_or_else(Vector6::zeros, |sent| sent.acceleration);
            let next = age.checked_sub(1).and_then(|age| self.recorded(age));
            let end_ns = next.map_or(to_ns, |next| next.begin_ns).min(to_ns);
            let dt = seconds_between(now_ns, end_ns);
            if dt > 0.0 {
                state.advance(dt, &acceleration);
                now_ns = end_ns;
            }
            if age == 0 || end_ns >= to_ns {
                return;
            }
            age -= 1;
        }
    }
}
