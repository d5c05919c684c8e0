//! Instants of a remote source's stamps on the clock of this host.

/// Interval in which the least delay is looked for: the clocks drift by a fraction of a millisecond in it \[ns\].
const INTERVAL_NS: i64 = 2_000_000_000;

/// Clock of one life of a source: its stamp plus the least delay of the last intervals.
///
/// Messages that were held up are late against the least delay. They never become the measure of it, however many there are. Only
/// another life of the source has another clock.
#[derive(Clone, Debug, Default)]
pub struct SourceClock {
    /// Least delay in this interval and in the one before \[ns\].
    least_ns: [Option<i64>; 2],
    interval_began_ns: i64,
    newest_ns: Option<i64>,
}

impl SourceClock {
    /// Instant of a stamp \[ns\]. `None` if it is later than `max_age_ns` or not newer than the newest.
    pub fn instant_ns(&mut self, stamp_ns: i64, arrival_ns: i64, max_age_ns: i64) -> Option<i64> {
        let delay_ns = arrival_ns.saturating_sub(stamp_ns);
        let known_ns = self.least_ns.into_iter().flatten().min();
        let is_late = known_ns.is_some_and(|known_ns| delay_ns.saturating_sub(known_ns) > max_age_ns);
        if is_late || self.newest_ns.is_some_and(|newest_ns| stamp_ns <= newest_ns) {
            return None;
        }
        self.newest_ns = Some(stamp_ns);
        if arrival_ns - self.interval_began_ns > INTERVAL_NS {
            (self.least_ns, self.interval_began_ns) = ([None, self.least_ns[0]], arrival_ns);
        }
        self.least_ns[0] = Some(self.least_ns[0].map_or(delay_ns, |least_ns| least_ns.min(delay_ns)));
        let least_ns = self.least_ns.into_iter().flatten().min()?;
        Some(stamp_ns.saturating_add(least_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn jitter_does_not_reach_the_instants() {
        let mut clock = SourceClock::default();
        for k in 0..600 {
            // A stamp every 16 ms, 100 ppm fast, with up to 9 ms of delay.
            let stamp = k * 16 * MS;
            let sent = 7_000 * MS + stamp - stamp / 10_000;
            let instant = clock.instant_ns(stamp, sent + 3 * MS + (k * 7 % 10) * MS, 100 * MS).unwrap();
            assert!((instant - sent - 3 * MS).abs() < MS || k < 10, "{k}: {} us", (instant - sent) / 1000);
        }
    }

    /// Five seconds of messages that arrive within `burst` \[ns\], then the stream goes on.
    #[test]
    fn messages_held_up_are_late_and_reset_no_clock() {
        for burst in [500, 4_000 * MS] {
            let mut clock = SourceClock::default();
            let (mut accepted, mut last_arrival) = (0, 0);
            for k in 0..2_000 {
                let stamp = k * 10 * MS;
                let is_held_up = (500..1_000).contains(&k);
                let arrival = if is_held_up { 10_000 * MS + (k - 500) * burst / 500 } else { stamp + MS };
                if arrival < last_arrival {
                    continue;
                }
                last_arrival = arrival;
                if let Some(instant) = clock.instant_ns(stamp, arrival, 100 * MS) {
                    accepted += 1;
                    assert!((instant - stamp - MS).abs() <= 1, "{k}");
                }
            }
            assert!((1_100..1_520).contains(&accepted), "{accepted}");
        }
    }
}
