//! Cycles of a recording that missed a deadline, counted as the loop does ([`hexad_client::realtime::cyclic`]).

use hexad_client::messages::CycleMessage;
use hexad_client::realtime::cyclic::{ReleaseMode, Timing, is_overrun};
use hexad_daemon::timing;
use hexad_machine::config::Config;

/// Deadlines that a cycle missed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Missed {
    /// The thread waited for the release, and began later after it than the threshold.
    pub is_late: bool,
    /// The cycle began before its next release and was still computing at it.
    pub is_overrun: bool,
}

/// Evaluation of consecutive cycles.
pub struct Deadlines {
    timing: Timing,
    /// Number of the previous cycle, and the instant of its end \[ns\].
    before: Option<(u64, u64)>,
}

impl Deadlines {
    /// Evaluation by the settings of a configuration.
    pub fn new(config: &Config) -> Self {
        Self { timing: timing(&config.deployment), before: None }
    }

    /// Whether cycles are released by a grid of instants. Only then a release can be skipped.
    pub fn has_grid(&self) -> bool {
        matches!(self.timing.release, ReleaseMode::Sleep | ReleaseMode::Hybrid)
    }

    /// Evaluates the next cycle.
    pub fn check(&mut self, cycle: &CycleMessage) -> Missed {
        let period_ns = self.timing.period_ns.max(1);
        let CycleMessage { due_ns, wakeup_ns, compute_ns, .. } = *cycle;
        // A cycle held for whole periods runs for the last release before it. Its wake-up latency counts from
        // the first.
        let skipped = if self.has_grid() { self.timing.on_overrun.skipped(wakeup_ns / period_ns) } else { 0 };
        let behind_ns = wakeup_ns - skipped * period_ns;
        let first_due_ns = due_ns.saturating_sub(skipped * period_ns);
        let is_run_at_once =
            self.before.is_some_and(|(number, done_ns)| number + 1 == cycle.cycle && first_due_ns <= done_ns);
        self.before = Some((cycle.cycle, due_ns + behind_ns + compute_ns));
        Missed {
            is_late: wakeup_ns > self.timing.late_wakeup_ns && !(self.has_grid() && is_run_at_once),
            is_overrun: is_overrun(behind_ns, compute_ns, period_ns),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evaluates cycles `(due, wake-up, computation)` \[µs\] at 1 kHz with a policy. Returns which are late
    /// and which overrun.
    fn judged(policy: &str, cycles: &[[u64; 3]]) -> Vec<(bool, bool)> {
        let text = include_str!("../../../config/fried2008.toml");
        let realtime = format!("rate_hz = 1000\nlate_wakeup_us = 200\n{policy}");
        let config = Config::parse(&format!("{text}\n[realtime]\n{realtime}\n"), "a test").unwrap();
        let mut deadlines = Deadlines::new(&config);
        let judge = |(k, us): (usize, &[u64; 3])| {
            let [due_ns, wakeup_ns, compute_ns] = us.map(|us| 1000 * us);
            let cycle = CycleMessage { cycle: k as u64, due_ns, wakeup_ns, compute_ns, ..Default::default() };
            let Missed { is_late, is_overrun } = deadlines.check(&cycle);
            (is_late, is_overrun)
        };
        cycles.iter().enumerate().map(judge).collect()
    }

    #[test]
    fn a_cycle_held_for_whole_periods_is_late_and_no_overrun() {
        // The second woke 2.3 ms late, 0.3 ms after the release for which it ran; the third computed beyond
        // its next release.
        let cycles = [[1000, 20, 10], [4000, 2300, 10], [5000, 20, 1500], [7000, 20, 979], [8000, 20, 980]];
        let expected = [(false, false), (true, false), (false, true), (false, false), (false, true)];
        assert_eq!(judged("on_overrun = \"skip\"", &cycles), expected);
    }

    #[test]
    fn a_cycle_that_catches_up_was_not_waited_for() {
        let cycles = [[1000, 20, 2500], [2000, 1520, 10], [3000, 530, 10], [4000, 250, 10]];
        let expected = [(false, true), (false, false), (false, false), (true, false)];
        assert_eq!(judged("on_overrun = \"catch_up\"", &cycles), expected);
    }
}
