//! Clock of a source that restarts without notice: no datagram says that a new life has begun.

use hexad_client::messages::source_clock::SourceClock;

/// Time for which every stamp is refused, after which the source counts as restarted \[ns\]. Messages that were held up on the way
/// arrive within less.
const RESTART_NS: i64 = 2_000_000_000;

/// Clock of the present life of a source. Its next life begins when it was refused for [`RESTART_NS`].
#[derive(Clone, Debug, Default)]
pub struct RestartingClock {
    clock: SourceClock,
    refused_since_ns: Option<i64>,
}

impl RestartingClock {
    /// Instant of a stamp \[ns\], as of [`SourceClock::instant_ns`].
    pub fn instant_ns(&mut self, stamp_ns: i64, arrival_ns: i64, max_age_ns: i64) -> Option<i64> {
        let instant_ns = self.clock.instant_ns(stamp_ns, arrival_ns, max_age_ns);
        if instant_ns.is_some() {
            self.refused_since_ns = None;
            return instant_ns;
        }
        let since_ns = *self.refused_since_ns.get_or_insert(arrival_ns);
        if arrival_ns - since_ns < RESTART_NS {
            return None;
        }
        *self = Self::default();
        self.clock.instant_ns(stamp_ns, arrival_ns, max_age_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simulator_that_begins_again_is_followed_again() {
        let mut clock = RestartingClock::default();
        let (mut last, step_ns) = (None, 10_000_000);
        for k in 0..1_000 {
            let stamp = if k < 500 { k } else { k - 500 } * step_ns;
            if clock.instant_ns(stamp, k * step_ns, 10 * step_ns).is_none() {
                last = Some(k);
            }
        }
        assert_eq!(last, Some(500 + 199), "for two seconds");
    }
}
