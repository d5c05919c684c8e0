//! What happened from one published cycle to the next: what the daemon counted, beside what its messages
//! show. Nothing here depends on how long anything took.

use std::collections::HashMap;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::messages::ForceMessage;

use super::recorder::Recording;

/// From a published cycle to the next one published.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub before: ForceMessage,
    pub after: ForceMessage,
    /// Number of the cycle of `after`.
    pub number: u64,
    pub cycles: u64,
    pub skipped: u64,
    pub late: u64,
    pub overruns: u64,
    pub caught_up: u64,
}

/// All of one life of the daemon, in order.
pub fn steps(recording: &Recording) -> Vec<Step> {
    let order = |header: &hexad::messages::Header| (header.epoch, header.sequence);
    let released: HashMap<_, _> = recording
        .forces
        .iter()
        .filter(|force| force.release_ns != 0 && force.diagnostic_code != DiagnosticCode::DaemonEnding as u32)
        .map(|force| (order(&force.header), *force))
        .collect();
    let published =
        recording.statuses.iter().filter_map(|status| Some((status, released.get(&order(&status.header))?)));
    let published: Vec<_> = published.collect();
    let steps = published.iter().zip(published.iter().skip(1)).map(|((a, before), (b, after))| {
        assert_eq!(a.header.epoch, b.header.epoch, "one life");
        Step {
            before: **before,
            after: **after,
            number: b.counters.cycles,
            cycles: b.counters.cycles - a.counters.cycles,
            skipped: b.counters.skipped - a.counters.skipped,
            late: b.counters.late_wakeups - a.counters.late_wakeups,
            overruns: b.counters.overruns - a.counters.overruns,
            caught_up: b.counters.caught_up - a.counters.caught_up,
        }
    });
    steps.collect()
}
