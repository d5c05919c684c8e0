//! Verdict on a rate: whether it is feasible on this host, from the distribution of its wake-ups.
//!
//! | verdict | when |
//! | --- | --- |
//! | good | 99.9 % of wake-ups within a fifth of the period, all within half, and no fact is bad |
//! | marginal | neither |
//! | impossible | at least one reason of the list below |
//!
//! A rate is impossible if
//!
//! - 1 % of wake-ups are later than half of the period,
//! - more than 1 % of releases are missed,
//! - one wake-up is later than a measurement may be old, or
//! - the daemon would not start.

use serde::{Deserialize, Serialize};

use super::latency::Latency;
use super::text::microseconds;
use hexad_client::messages::Times;

/// Largest 99.9th percentile of a good rate, as a share of the period. The rest is for reading, computing and
/// sending.
const GOOD_SHARE: f64 = 0.2;
/// Largest wake-up of a good rate, and largest 99th percentile of a feasible one, as a share of the period.
/// Beyond it, a cycle may not end in time.
const LATEST_SHARE: f64 = 0.5;
/// Largest share of missed releases. With more, the loop does not run at the rate for which its gains were
/// computed.
const MAX_MISSED_SHARE: f64 = 0.01;

/// Feasibility of a rate on a host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Feasibility {
    Good,
    Marginal,
    Impossible,
}

/// Conditions of the host and the deployment that hold for every rate.
#[derive(Clone, Debug, Default)]
pub struct HostConditions {
    /// `timeouts.measured_ms`. After a longer pause of its thread, the loop treats its measurement as lost.
    pub longest_hold_ns: u64,
    /// Names of the bad facts.
    pub bad: Vec<String>,
    /// Reason why the daemon would not start.
    pub refusal: Option<String>,
}

/// Measured latency at one rate and release mode, with its verdict.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RateVerdict {
    #[serde(flatten)]
    pub latency: Latency,
    pub verdict: Feasibility,
    pub reasons: Vec<String>,
}

/// Assesses one rate and release mode.
pub fn assess(latency: Latency, conditions: &HostConditions) -> RateVerdict {
    let (impossible, marginal) = (obstacles(&latency, conditions), shortcomings(&latency, conditions));
    let (verdict, reasons) = match (impossible.is_empty(), marginal.is_empty()) {
        (false, _) => (Feasibility::Impossible, impossible),
        (true, false) => (Feasibility::Marginal, marginal),
        (true, true) => (Feasibility::Good, vec![rare(&latency)]),
    };
    RateVerdict { latency, verdict, reasons }
}

/// Reasons why a rate is impossible.
fn obstacles(latency: &Latency, conditions: &HostConditions) -> Vec<String> {
    let HostConditions { longest_hold_ns, refusal, .. } = conditions;
    let Latency { wakeup_ns, missed, .. } = latency;
    let mut reasons: Vec<_> = refusal.iter().cloned().collect();
    if share(latency, wakeup_ns.p99) > LATEST_SHARE {
        reasons.push(within(latency, "99% of wake-ups within", wakeup_ns.p99, LATEST_SHARE));
    }
    let releases = wakeup_ns.count + missed;
    let missed_share = *missed as f64 / releases.max(1) as f64;
    if missed_share > MAX_MISSED_SHARE {
        reasons.push(format!(
            "{missed} of {releases} releases missed, {:.1}% (limit {:.0}%)",
            100.0 * missed_share,
            100.0 * MAX_MISSED_SHARE
        ));
    }
    // At a low rate one period is longer than the timeout.
    let longest_ns = (*longest_hold_ns).max(latency.period_ns() as u64);
    if wakeup_ns.max > longest_ns {
        reasons.push(format!(
            "one wake-up {} ms late, and a measurement is lost after {} ms (timeouts.measured_ms)",
            milliseconds(wakeup_ns.max),
            milliseconds(longest_ns)
        ));
    }
    if wakeup_ns.count == 0 {
        reasons.push("no wake-up was seen".into());
    }
    reasons
}

/// Reasons why a rate is not good.
fn shortcomings(latency: &Latency, conditions: &HostConditions) -> Vec<String> {
    let Latency { wakeup_ns, missed, .. } = latency;
    let mut reasons = vec![];
    if share(latency, wakeup_ns.p999) > GOOD_SHARE {
        reasons.push(rare(latency));
    }
    // With few wake-ups, the line above has already reported the longest.
    if share(latency, wakeup_ns.max) > LATEST_SHARE && wakeup_ns.max > wakeup_ns.p999 {
        reasons.push(within(latency, "the longest wake-up after", wakeup_ns.max, LATEST_SHARE));
    }
    if *missed > 0 {
        reasons.push(format!("{missed} of {} releases missed", wakeup_ns.count + missed));
    }
    if reasons.is_empty() && !conditions.bad.is_empty() {
        reasons.push(format!("{}; but bad: {}", rare(latency), conditions.bad.join(", ")));
    }
    reasons
}

/// A time as a share of the period.
fn share(latency: &Latency, time_ns: u64) -> f64 {
    time_ns as f64 / latency.period_ns()
}

/// Text for the 99.9th percentile, or for the longest wake-up if there are too few.
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
    use hexad_client::realtime::cyclic::ReleaseMode;
    use hexad_client::realtime::usage::ThreadUsage;

    const MAX_HOLD_NS: u64 = 20_000_000;

    fn conditions() -> HostConditions {
        HostConditions { longest_hold_ns: MAX_HOLD_NS, ..HostConditions::default() }
    }

    /// 10000 wake-ups at 1 kHz \[us\].
    fn latency(p99: u64, p999: u64, max: u64, missed: u64) -> Latency {
        let [p99, p999, max] = [p99, p999, max].map(|us| us * 1000);
        Latency {
            rate_hz: 1000.0,
            release: ReleaseMode::Sleep,
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
    fn each_limit_separates_two_verdicts() {
        use Feasibility::{Good, Impossible, Marginal};
        for (p99, p999, max, missed, feasibility) in [
            (50, 200, 500, 0, Good),
            (50, 201, 500, 0, Marginal),
            (50, 200, 501, 0, Marginal),
            (500, 900, 2000, 100, Marginal),
            (501, 900, 2000, 1, Impossible),
            (50, 900, 2000, 101, Impossible),
            (50, 200, 20_000, 19, Marginal),
            (50, 200, 20_001, 20, Impossible),
        ] {
            let verdict = assess(latency(p99, p999, max, missed), &conditions());
            assert_eq!(verdict.verdict, feasibility, "{p99} {p999} {max} {missed}: {verdict:?}");
            assert!(!verdict.reasons.is_empty());
        }
    }

    #[test]
    fn at_a_low_rate_a_whole_period_may_be_longer_than_the_timeout() {
        let slow = Latency { rate_hz: 10.0, ..latency(50, 200, 30_000, 0) };
        assert_eq!(assess(slow, &conditions()).verdict, Feasibility::Good);
    }

    #[test]
    fn a_rate_without_measurements_is_impossible() {
        let none = Latency { wakeup_ns: Times::default(), ..latency(0, 0, 0, 0) };
        assert_eq!(assess(none, &conditions()).verdict, Feasibility::Impossible);
    }

    #[test]
    fn a_bad_fact_forbids_good_and_a_refusal_everything() {
        let quiet = latency(50, 60, 70, 0);
        let bad = HostConditions { bad: vec!["kernel".into(), "machine".into()], ..conditions() };
        let verdict = assess(quiet.clone(), &bad);
        assert_eq!(verdict.verdict, Feasibility::Marginal);
        let words = "99.9% of wake-ups within 60 us, 6% of the period (limit 20%); but bad: kernel, machine";
        assert_eq!(verdict.reasons, [words]);
        let refused = HostConditions { refusal: Some("it would not start".into()), ..bad };
        let verdict = assess(quiet, &refused);
        assert_eq!(verdict.reasons, ["it would not start"]);
        assert_eq!(verdict.verdict, Feasibility::Impossible);
    }
}
