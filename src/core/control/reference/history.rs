//! History of the reference over the last cycles, for its motion at the instant of a measurement.

use serde::{Deserialize, Serialize};

use crate::control::signals::time::seconds_between;
use crate::model::rigid::{Acceleration, Motion, Twist};

/// Number of segments kept, a power of two: 128 ms at 1 kHz, 6 ms at 20 kHz. The motion at an older instant,
/// as of a measurement behind a longer delay of the drives, is extrapolated at constant acceleration. The
/// error is 5 um in 4 ms at a jerk of 500 m/s^3.
const SEGMENT_COUNT: usize = 128;

/// Motion of the reference from one instant to the next, with constant jerk.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Segment {
    begin_ns: u64,
    motion: Motion,
    jerk: Acceleration,
}

/// Ring buffer of the last segments.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct History {
    #[serde(with = "serde_big_array::BigArray")]
    segments: [Option<Segment>; SEGMENT_COUNT],
    /// Number of segments ever recorded; the last one has the index `total_recorded - 1`.
    total_recorded: usize,
}

impl Default for History {
    fn default() -> Self {
        Self { segments: [None; SEGMENT_COUNT], total_recorded: 0 }
    }
}

impl History {
    /// Forgets all segments.
    pub fn clear(&mut self) {
        self.total_recorded = 0;
    }

    /// Records the segment from `motion` at `begin_ns` to the acceleration `next`, `dt_s` seconds later.
    pub fn record(&mut self, begin_ns: u64, motion: &Motion, next: &Acceleration, dt_s: f64) {
        let jerk = Acceleration::from_vector(&((next.vector() - motion.acceleration.vector()) / dt_s));
        if let Some(slot) = self.segments.get_mut(self.total_recorded % SEGMENT_COUNT) {
            *slot = Some(Segment { begin_ns, motion: *motion, jerk });
        }
        self.total_recorded += 1;
    }

    /// Motion at an instant, extrapolated before the first and after the last segment.
    pub fn motion_at(&self, instant_ns: u64) -> Option<Motion> {
        let kept = self.total_recorded.min(SEGMENT_COUNT);
        let recorded = |age: usize| {
            self.segments.get((self.total_recorded - age) % SEGMENT_COUNT).and_then(Option::as_ref)
        };
        let contains = |age| recorded(age).is_some_and(|segment| segment.begin_ns <= instant_ns);
        // The newest segment that begins no later than the instant: most often one of the last, else found by
        // bisection.
        let (mut newer, mut older) = (0, 1);
        while older < kept && !contains(older) {
            (newer, older) = (older, 2 * older);
        }
        older = older.min(kept);
        while newer + 1 < older {
            let middle = newer.midpoint(older);
            if contains(middle) {
                older = middle;
            } else {
                newer = middle;
            }
        }
        recorded(older).filter(|_| kept > 0).map(|segment| segment.motion_at(instant_ns))
    }
}

impl Segment {
    fn motion_at(&self, instant_ns: u64) -> Motion {
        let t = seconds_between(self.begin_ns, instant_ns);
        // The jerk before the first segment is unknown and taken as zero.
        let jerk = if t > 0.0 { self.jerk.vector() } else { Acceleration::default().vector() };
        let Motion { pose, twist, acceleration } = &self.motion;
        let (v, a) = (twist.vector(), acceleration.vector());
        let displacement = Twist::from_vector(&((v + (a / 2.0 + jerk * (t / 6.0)) * t) * t));
        Motion {
            pose: pose.extrapolated(&displacement),
            twist: Twist::from_vector(&(v + (a + jerk * (0.5 * t)) * t)),
            acceleration: Acceleration::from_vector(&(a + jerk * t)),
        }
    }
}
