//! The reference of a recording at any instant. A cycle contains the reference at the end of the hold of its
//! force.

use std::collections::VecDeque;

use hexad_core::control::signals::time::seconds_between;
use hexad_core::model::rigid::{Acceleration, Motion, Twist};

/// Number of references kept: more periods than the age of any measurement.
const KEPT: usize = 256;

/// Longest time between consecutive references of one motion \[s\].
const MAX_INTERVAL_S: f64 = 0.1;

/// The last references with their instants \[ns\].
#[derive(Default)]
pub struct References {
    motions: VecDeque<(u64, Motion)>,
}

impl References {
    /// Adds the reference at a later instant. Drops the references before a pause or the end of control.
    pub fn add(&mut self, instant_ns: u64, motion: Option<&Motion>) {
        let is_continued = |(before_ns, _): &(u64, Motion)| {
            let interval_s = seconds_between(*before_ns, instant_ns);
            interval_s > 0.0 && interval_s <= MAX_INTERVAL_S
        };
        if motion.is_none() || !self.motions.back().is_some_and(is_continued) {
            self.motions.clear();
        }
        if self.motions.len() == KEPT {
            self.motions.pop_front();
        }
        self.motions.extend(motion.map(|motion| (instant_ns, *motion)));
    }

    /// The reference at an instant: with constant jerk between two references, as the controller moves it;
    /// with constant acceleration before the first and after the last.
    pub fn at(&self, instant_ns: u64) -> Option<Motion> {
        let behind = self.motions.partition_point(|(begin_ns, _)| *begin_ns <= instant_ns);
        let (begin_ns, motion) = self.motions.get(behind.saturating_sub(1))?;
        let t = seconds_between(*begin_ns, instant_ns);
        let (v, a) = (motion.twist.vector(), motion.acceleration.vector());
        let next = self.motions.get(behind).filter(|_| behind > 0);
        let jerk = next.map_or_else(Default::default, |(end_ns, next)| {
            (next.acceleration.vector() - a) / seconds_between(*begin_ns, *end_ns)
        });
        let displacement = Twist::from_vector(&((v + (a / 2.0 + jerk * (t / 6.0)) * t) * t));
        Some(Motion {
            pose: motion.pose.extrapolated(&displacement),
            twist: Twist::from_vector(&(v + (a + jerk * (0.5 * t)) * t)),
            acceleration: Acceleration::from_vector(&(a + jerk * t)),
        })
    }
}
