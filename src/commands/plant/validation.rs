//! Validation of force messages: which of them the plant applies.
//!
//! A rejected message has no effect: the last force expires by its own age, and then the brakes close. So a
//! bad message never refreshes the watchdog, and a bad one among good ones does no harm. The port validates
//! schema, checksum and sequence, before a damaged epoch could take precedence over a good one.

use tracing::warn;

use hexad_client::messages::{ForceMessage, RejectionCounts};

/// Reasons for a rejection, in the order of the counts.
const REASONS: [&str; 6] = [
    "of another schema: build all participants alike",
    "with a wrong checksum, or of a publisher that begins in the future",
    "of an older daemon",
    "received before, or unreadable",
    "older than plant.force_timeout_ms",
    "from the future: stamp with CLOCK_MONOTONIC",
];

/// Counts of rejected force messages, by reason; the first of each kind is logged.
#[derive(Debug, Default)]
pub struct ForceValidation {
    counts: [u64; REASONS.len()],
    logged: [bool; REASONS.len()],
}

impl ForceValidation {
    /// Whether the time stamp of a message is neither in the future nor older than the timeout.
    pub fn accepts(&mut self, message: &ForceMessage, now_ns: u64, timeout_ns: u64) -> bool {
        let sent_ns = message.header.time_ns;
        let (is_old, is_future) = (now_ns.saturating_sub(sent_ns) > timeout_ns, sent_ns > now_ns);
        let [.., old, future] = &mut self.counts;
        *old += u64::from(is_old);
        *future += u64::from(is_future);
        !is_old && !is_future
    }

    /// Adopts the counts of the port, and logs new reasons.
    pub fn update(&mut self, rejected: RejectionCounts) {
        let RejectionCounts { schema, other_publisher, repeated, damaged } = rejected;
        let [of_schema, of_damaged, of_older, of_repeated, ..] = &mut self.counts;
        (*of_schema, *of_damaged, *of_older, *of_repeated) = (schema, damaged, other_publisher, repeated);
        for ((count, logged), reason) in self.counts.iter().zip(&mut self.logged).zip(REASONS) {
            if *count > 0 && !*logged {
                warn!("rejected: a force {reason}");
                *logged = true;
            }
        }
    }

    /// Logs the number of each kind, at the end.
    pub fn log_totals(&self) {
        for (count, reason) in self.counts.iter().zip(REASONS).filter(|(count, _)| **count > 0) {
            warn!(count, "rejected in total: forces {reason}");
        }
    }
}
