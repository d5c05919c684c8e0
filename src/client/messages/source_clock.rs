//! Instants of a remote source's stamps on the clock of this host.
//!
//! A stamp and its arrival are all that is known. A clock that is slow by a twentieth, and messages that wait longer and longer, look
//! alike: so the operator says by `setpoint.clock` what the stamps are, and whatever contradicts it is rejected by name.

#[cfg(test)]
mod tests;

/// What the stamps of remote sources are: `setpoint.clock`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockRule {
    /// Of a clock that runs as this host's does.
    #[default]
    RealTime,
    /// Of a steady clock, such as simulated time: its rate is measured before the source is followed.
    AnyRate,
    /// Nothing: a setpoint is of its arrival.
    Arrival,
}

/// Instant of a message, and seconds of the source's clock in a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceInstant {
    /// On the clock of this host \[ns\].
    pub time_ns: i64,
    /// Of the source's clock: a derivative with respect to its time, times this, is one with respect to real time.
    pub rate_ratio: f64,
}

/// Why a message has no instant.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoInstant {
    /// Before the source is followed.
    #[error(
        "the rate of its clock is measured for 2 s before it is followed (setpoint.clock = \"any_rate\")"
    )]
    Measured,
    /// Two messages of one stamp.
    #[error(
        "its stamp repeats the last one: stamp each message, or set setpoint.clock = \"arrival\" in the machine file"
    )]
    Repeated,
    /// Late, or older than the newest.
    #[error(
        "it is later than the stream by more than {0:.0} ms, or older than the newest one: if its clock was set back, start the source again"
    )]
    Late(f64),
    /// All are late, as by a clock of another rate.
    #[error(
        "it is late, and its clock runs at {0:.3} of real time: for simulated time set setpoint.clock = \"any_rate\" in the machine file; \
         else its messages wait longer and longer on the way"
    )]
    Rate(f64),
    /// The same after another rate was measured; 0 for none.
    #[error(
        "its clock runs at {0:.3} of real time, before {1:.3}; followed is one of 0.1 to 10 that stays: if that is meant start the source \
         again; else its messages wait longer and longer on the way"
    )]
    Changed(f64, f64),
}

/// Interval in which the least delay is looked for: the clocks drift by a fraction of a millisecond in it \[ns\].
const INTERVAL_NS: i64 = 2_000_000_000;

/// Time over which a rate is measured \[ns\], and the least number of messages in it.
const MEASURED_NS: i64 = 2_000_000_000;
const MEASURED_MESSAGES: usize = 20;

/// Interruption after which a measurement begins anew \[ns\].
const INTERRUPTION_NS: i64 = 500_000_000;

/// Rates of a clock that are followed.
const RATES: core::ops::RangeInclusive<f64> = 0.1..=10.0;

/// Ratio of two measurements of one rate, in two seconds of jitter.
const SAME: core::ops::RangeInclusive<f64> = 0.99..=1.01;

/// What a clock may lose against this host's without being late: two crystals, and what is left of a measured rate.
const REAL_TIME_DRIFT: f64 = 2e-4;
const MEASURED_DRIFT: f64 = 2e-3;

/// Clock of a source.
///
/// Messages that were held up are late against the least delay. They never become the measure of it, however many there are. Another
/// life of the source has another clock; without notice, one begins when all were late for two seconds while the delay did not grow.
#[derive(Clone, Debug)]
pub struct SourceClock {
    rule: ClockRule,
    max_age_ns: i64,
    /// Whether another life of the source begins without notice.
    restarts: bool,
    /// Lives of the source so far.
    lives: u32,
    line: Option<Line>,
    /// Stamps and arrivals of messages without an instant \[ns\].
    measured: Vec<[i64; 2]>,
}

impl SourceClock {
    /// Clock of a source whose messages are late beyond an age. `restarts`: another life of it begins without notice.
    pub fn new(rule: ClockRule, max_age_ns: i64, restarts: bool) -> Self {
        Self {
            rule,
            max_age_ns,
            restarts: restarts || rule == ClockRule::AnyRate,
            lives: 0,
            line: None,
            measured: vec![],
        }
    }

    /// Seconds of its clock in a second, once it is known.
    pub fn rate(&self) -> Option<f64> {
        self.line.as_ref().map(|line| line.rate)
    }

    /// How often the source has begun. A clock that only stood, as that of a game in its menu, goes on with its stamps.
    pub fn lives(&self) -> u32 {
        self.lives
    }

    /// Instant of a stamp.
    pub fn instant(&mut self, stamp_ns: i64, arrival_ns: i64) -> Result<SourceInstant, NoInstant> {
        let line = match (self.rule, &mut self.line) {
            (ClockRule::Arrival, _) => return Ok(SourceInstant { time_ns: arrival_ns, rate_ratio: 1.0 }),
            (ClockRule::RealTime, none @ None) => Some(none.insert(Line::new(1.0, REAL_TIME_DRIFT))),
            (_, line) => line.as_mut(),
        };
        let reason = match line.map(|line| line.instant(stamp_ns, arrival_ns, self.max_age_ns)) {
            Some(Ok(instant)) => {
                self.measured.clear();
                return Ok(instant);
            }
            Some(Err(reason)) => reason,
            None => NoInstant::Measured,
        };
        let Some(rate) = self.measure(stamp_ns, arrival_ns) else { return Err(reason) };
        if !self.may_follow(rate) {
            return Err(match (self.rule, self.rate_before()) {
                (_, Some(before)) if SAME.contains(&(rate / before)) => reason,
                (ClockRule::RealTime, _) => NoInstant::Rate(rate),
                (_, before) => NoInstant::Changed(rate, before.unwrap_or_default()),
            });
        }
        let mut line = match self.rule {
            ClockRule::RealTime => Line::new(1.0, REAL_TIME_DRIFT),
            _ => Line::new(rate, MEASURED_DRIFT),
        };
        let goes_on = self.goes_on();
        // The measured messages give the least delay.
        for [stamp_ns, arrival_ns] in core::mem::take(&mut self.measured) {
            let _ = line.instant(stamp_ns, arrival_ns, i64::MAX);
        }
        line.newest_ns = None;
        self.lives += u32::from(!goes_on);
        self.line.insert(line).instant(stamp_ns, arrival_ns, self.max_age_ns)
    }

    /// Whether a source with this rate is followed from now on. While its stamps go on, a queue explains another rate.
    fn may_follow(&self, rate: f64) -> bool {
        let before = self.rate_before();
        self.restarts && before.map_or(RATES.contains(&rate), |before| SAME.contains(&(rate / before)))
    }

    /// The rate before: of a source whose stamps go on, or of real time.
    fn rate_before(&self) -> Option<f64> {
        let line = self.line.as_ref()?;
        (self.goes_on() || self.rule == ClockRule::RealTime).then_some(line.rate)
    }

    /// Whether the stamps of the messages without an instant follow the others.
    fn goes_on(&self) -> bool {
        let newest_ns = self.line.as_ref().and_then(|line| line.newest_ns);
        newest_ns.is_some() && self.measured.first().is_some_and(|[stamp_ns, _]| newest_ns <= Some(*stamp_ns))
    }

    /// Adds a message without an instant. The rate, each time that enough of a steady stream was added.
    fn measure(&mut self, stamp_ns: i64, arrival_ns: i64) -> Option<f64> {
        if let Some([stamp_before, arrival_before]) = self.measured.last() {
            if stamp_ns == *stamp_before {
                return None;
            }
            if stamp_ns < *stamp_before || arrival_ns - arrival_before > INTERRUPTION_NS {
                self.measured.clear();
            }
        }
        self.measured.push([stamp_ns, arrival_ns]);
        let [_, began_ns] = self.measured.first()?;
        if self.measured.len() < MEASURED_MESSAGES || arrival_ns - began_ns < MEASURED_NS {
            return None;
        }
        let (rate, spread_ns) = fitted(&self.measured);
        if spread_ns <= self.max_age_ns as f64 && self.may_follow(rate) {
            return Some(rate);
        }
        self.measured.drain(..self.measured.len() / 2);
        (spread_ns <= self.max_age_ns as f64).then_some(rate)
    }
}

/// Rate of a clock by stamps and arrivals, and the largest delay beyond the line of the least ones \[ns\]: the edge of the lower convex
/// hull at the middle (Moon, Skelly and Towsley 1999, "Estimation and removal of clock skew from network delay measurements").
fn fitted(points: &[[i64; 2]]) -> (f64, f64) {
    let Some([stamp_0, arrival_0]) = points.first() else { return (1.0, 0.0) };
    let relative = |[stamp, arrival]: &[i64; 2]| [(stamp - stamp_0) as f64, (arrival - arrival_0) as f64];
    let below =
        |[a, b]: [[f64; 2]; 2], c: [f64; 2]| (b[1] - a[1]) * (c[0] - a[0]) < (c[1] - a[1]) * (b[0] - a[0]);
    let mut hull: Vec<[f64; 2]> = vec![];
    for point in points.iter().map(relative) {
        while let [.., a, b] = hull[..] {
            if below([a, b], point) {
                break;
            }
            hull.pop();
        }
        hull.push(point);
    }
    let middle = 0.5 * hull.last().map_or(0.0, |[stamp, _]| *stamp);
    let edges = hull.iter().zip(hull.iter().skip(1));
    let edge = edges.into_iter().find(|(_, end)| end[0] >= middle).unwrap_or((&[0.0; 2], &[1.0; 2]));
    let (begin, end) = edge;
    let slope = (end[1] - begin[1]) / (end[0] - begin[0]);
    let beyond = |[stamp, arrival]: [f64; 2]| arrival - begin[1] - slope * (stamp - begin[0]);
    (1.0 / slope, points.iter().map(relative).map(beyond).fold(0.0, f64::max))
}

/// Stamps and arrivals of a source at one rate.
#[derive(Clone, Debug)]
struct Line {
    rate: f64,
    drift: f64,
    /// Stamp and arrival of the first message \[ns\].
    origin_ns: Option<[i64; 2]>,
    newest_ns: Option<i64>,
    /// Least delay in this interval and in the one before \[ns\].
    least_ns: [Option<i64>; 2],
    interval_began_ns: i64,
    /// Least delay of all, less what the clock may have lost until then \[ns\].
    floor_ns: i64,
}

impl Line {
    fn new(rate: f64, drift: f64) -> Self {
        let (least_ns, interval_began_ns) = ([None; 2], i64::MIN);
        Self {
            rate,
            drift,
            origin_ns: None,
            newest_ns: None,
            least_ns,
            interval_began_ns,
            floor_ns: i64::MAX,
        }
    }

    fn instant(
        &mut self,
        stamp_ns: i64,
        arrival_ns: i64,
        max_age_ns: i64,
    ) -> Result<SourceInstant, NoInstant> {
        if self.newest_ns == Some(stamp_ns) {
            return Err(NoInstant::Repeated);
        }
        let [stamp_0, arrival_0] = *self.origin_ns.get_or_insert([stamp_ns, arrival_ns]);
        let elapsed_ns = arrival_ns.saturating_sub(arrival_0);
        let sent_ns = arrival_0.saturating_add((stamp_ns.saturating_sub(stamp_0) as f64 / self.rate) as i64);
        let delay_ns = arrival_ns.saturating_sub(sent_ns);
        let undrifted_ns = delay_ns.saturating_sub((self.drift * elapsed_ns as f64) as i64);
        let is_old = self.newest_ns.is_some_and(|newest_ns| stamp_ns < newest_ns);
        if is_old || undrifted_ns.saturating_sub(self.floor_ns.min(undrifted_ns)) > max_age_ns {
            return Err(NoInstant::Late(1e-6 * max_age_ns as f64));
        }
        (self.newest_ns, self.floor_ns) = (Some(stamp_ns), self.floor_ns.min(undrifted_ns));
        if arrival_ns.saturating_sub(self.interval_began_ns) > INTERVAL_NS {
            (self.least_ns, self.interval_began_ns) = ([None, self.least_ns[0]], arrival_ns);
        }
        let least_ns = self.least_ns.into_iter().flatten().fold(delay_ns, i64::min);
        self.least_ns[0] = Some(self.least_ns[0].map_or(delay_ns, |known_ns| known_ns.min(delay_ns)));
        Ok(SourceInstant { time_ns: sent_ns.saturating_add(least_ns), rate_ratio: self.rate })
    }
}
