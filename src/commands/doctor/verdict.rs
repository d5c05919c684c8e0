//! Whether a rate is possible on this host, from how its wake-ups are distributed.
//!
//! | verdict | when |
//! | --- | --- |
//! | good | 99.9 % of wake-ups within a fifth of the period, all within half, and no fact is bad |
//! | marginal | neither |
//! | impossible | 1 % of wake-ups beyond half of the period, or more than 1 % of releases missed, or one wake-up later than a measurement may be old, or the daemon would not start |

use serde::{Deserialize, Serialize};

use super::latency::Latency;
use super::text::microseconds;
use crate::messages::Times;

/// Of the period, for the 99.9th percentile: the rest is for reading, computing and sending.
const GOOD_SHARE: f64 = 0.2;
/// Of the period, for the longest, or for the 99th percentile: later, a cycle may not be done in time.
const LATEST_SHARE: f64 = 0.5;
/// Of the releases: with more, the loop does not have the rate that its gains were computed for.
const MOST_MISSED: f64 = 0.01;

/// Whether a rate is possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Judgement {
    Good,
    Marginal,
    Impossible,
}

/// What holds for every rate.
#[derive(Clone, Debug, Default)]
pub struct Circumstances {
    /// `timeouts.measured_ms`: a thread held for longer finds that its measurement is lost.
    pub longest_hold_ns: u64,
    /// Names of the facts that are bad.
    pub bad: Vec<String>,
    /// Why the daemon would not start.
    pub refusal: Option<String>,
}

/// A judgement and its reasons.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    pub judgement: Judgement,
    pub why: Vec<String>,
}

/// Judges one rate.
pub fn judge(latency: &Latency, circumstances: &Circumstances) -> Verdict {
    let impossible = against_any(latency, circumstances);
    if !impossible.is_empty() {
        return Verdict { judgement: Judgement::Impossible, why: impossible };
    }
    let marginal = against_good(latency, circumstances);
    if !marginal.is_empty() {
        return Verdict { judgement: Judgement::Marginal, why: marginal };
    }
    Verdict { judgement: Judgement::Good, why: vec![rare(latency)] }
}

fn against_any(latency: &Latency, circumstances: &Circumstances) -> Vec<String> {
    let Circumstances { longest_hold_ns, refusal, .. } = circumstances;
    let Latency { wakeup_ns, missed, .. } = latency;
    let mut why: Vec<_> = refusal.iter().cloned().collect();
    if share(latency, wakeup_ns.p99) > LATEST_SHARE {
        why.push(within(latency, "99% of wake-ups within", wakeup_ns.p99, LATEST_SHARE));
    }
    let releases = wakeup_ns.count + missed;
    let missed_share = *missed as f64 / releases.max(1) as f64;
    if missed_share > MOST_MISSED {
        why.push(format!(
            "{missed} of {releases} releases missed, {:.1}% (limit {:.0}%)",
            100.0 * missed_share,
            100.0 * MOST_MISSED
        ));
    }
    // At a low rate one period is longer than that.
    let longest_ns = (*longest_hold_ns).max(latency.period_ns() as u64);
    if wakeup_ns.max > longest_ns {
        why.push(format!(
            "one wake-up {} ms late, and a measurement is lost after {} (timeouts.measured_ms)",
            milliseconds(wakeup_ns.max),
            milliseconds(longest_ns)
        ));
    }
    if wakeup_ns.count == 0 {
        why.push("no wake-up was seen".into());
    }
    why
}

fn against_good(latency: &Latency, circumstances: &Circumstances) -> Vec<String> {
    let Latency { wakeup_ns, missed, .. } = latency;
    let mut why = vec![];
    if share(latency, wakeup_ns.p999) > GOOD_SHARE {
        why.push(rare(latency));
    }
    // Of few wake-ups it has been said.
    if share(latency, wakeup_ns.max) > LATEST_SHARE && wakeup_ns.max > wakeup_ns.p999 {
        why.push(within(latency, "the longest wake-up after", wakeup_ns.max, LATEST_SHARE));
    }
    if *missed > 0 {
        why.push(format!("{missed} of {} releases missed", wakeup_ns.count + missed));
    }
    if why.is_empty() && !circumstances.bad.is_empty() {
        why.push(format!("{}; but bad: {}", rare(latency), circumstances.bad.join(", ")));
    }
    why
}

/// Of the period.
fn share(latency: &Latency, time_ns: u64) -> f64 {
    time_ns as f64 / latency.period_ns()
}

/// The 99.9th percentile; of fewer wake-ups than it takes, the longest stands for it.
fn rare(latency: &Latency) -> String {
    let Times { count, p999, .. } = latency.wakeup_ns;
    let how_many = if count < 1000 { format!("all {count}") } else { "99.9% of".into() };
    within(latency, &format!("{how_many} wake-ups within"), p999, GOOD_SHARE)
}

fn within(latency: &Latency, what: &str, time_ns: u64, limit: f64) -> String {
    format!(
        "{what} {} us, {:.0}% of the period (limit {:.0}%)",
        microseconds(time_ns),
        100.0 * share(latency, time_ns),
        100.0 * limit
    )
}

fn milliseconds(time_ns: u64) -> String {
    format!("{:.1}", time_ns as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::latency::Waiting;
    use crate::realtime::usage::ThreadUsage;

    const LIMITS: u64 = 20_000_000;

    fn circumstances() -> Circumstances {
        Circumstances { longest_hold_ns: LIMITS, ..Circumstances::default() }
    }

    /// 10000 wake-ups at 1 kHz \[us\].
    fn latency(p99: u64, p999: u64, max: u64, missed: u64) -> Latency {
        let [p99, p999, max] = [p99, p999, max].map(|us| us * 1000);
        Latency {
            rate_hz: 1000.0,
            release: Waiting::Sleep,
            wakeup_ns: Times { count: 10_000 - missed, p99, p999, p9999: max, max, ..Times::default() },
            late_wakeup_ns: 200_000,
            late_wakeups: 0,
            missed,
            lead_ns: 0,
            stolen_ms: None,
            thread: ThreadUsage::default(),
        }
    }

    #[test]
    fn each_limit_separates_two_judgements() {
        use Judgement::{Good, Impossible, Marginal};
        for (p99, p999, max, missed, judgement) in [
            (50, 200, 500, 0, Good),
            (50, 201, 500, 0, Marginal),
            (50, 200, 501, 0, Marginal),
            (500, 900, 2000, 100, Marginal),
            (501, 900, 2000, 1, Impossible),
            (50, 900, 2000, 101, Impossible),
            (50, 200, 20_000, 19, Marginal),
            (50, 200, 20_001, 20, Impossible),
        ] {
            let verdict = judge(&latency(p99, p999, max, missed), &circumstances());
            assert_eq!(verdict.judgement, judgement, "{p99} {p999} {max} {missed}: {verdict:?}");
            assert!(!verdict.why.is_empty());
        }
    }

    #[test]
    fn at_a_low_rate_a_whole_period_may_be_longer_than_the_timeout() {
        let slow = Latency { rate_hz: 10.0, ..latency(50, 200, 30_000, 0) };
        assert_eq!(judge(&slow, &circumstances()).judgement, Judgement::Good);
    }

    #[test]
    fn what_was_not_measured_is_not_possible() {
        let none = Latency { wakeup_ns: Times::default(), ..latency(0, 0, 0, 0) };
        assert_eq!(judge(&none, &circumstances()).judgement, Judgement::Impossible);
    }

    #[test]
    fn a_bad_fact_forbids_good_and_a_refusal_everything() {
        let quiet = latency(50, 60, 70, 0);
        let bad = Circumstances { bad: vec!["kernel".into(), "machine".into()], ..circumstances() };
        let verdict = judge(&quiet, &bad);
        assert_eq!(verdict.judgement, Judgement::Marginal);
        let words = "99.9% of wake-ups within 60 us, 6% of the period (limit 20%); but bad: kernel, machine";
        assert_eq!(verdict.why, [words]);
        let refused = Circumstances { refusal: Some("it would not start".into()), ..bad };
        let verdict = judge(&quiet, &refused);
        assert_eq!(verdict.why, ["it would not start"]);
        assert_eq!(verdict.judgement, Judgement::Impossible);
    }
}
