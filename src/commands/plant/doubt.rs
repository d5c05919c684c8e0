//! Which force messages a driver believes.
//!
//! What it does not believe is as good as not sent: the force before it runs out by its own age, and then the
//! brakes close. So bad messages never refresh the watchdog, and one among good ones does no harm. Schema,
//! checksum and sequence are the port's to judge: a damaged epoch must not outrank a good one.

use tracing::warn;

use crate::messages::ports::Rejected;
use crate::messages::structs::ForceMessage;

/// Why a message is not believed, in the order of the counts.
const REASONS: [&str; 6] = [
    "of another schema: build all participants alike",
    "with a wrong checksum, or of a source that begins in the future",
    "of an older daemon",
    "seen before, or unreadable",
    "older than plant.force_timeout_ms",
    "from the future: stamp with CLOCK_MONOTONIC",
];

/// Counts what it does not believe, and tells the first of each kind.
#[derive(Debug, Default)]
pub struct Doubt {
    counts: [u64; REASONS.len()],
    told: [bool; REASONS.len()],
}

impl Doubt {
    /// Whether a message is of now.
    pub fn believes(&mut self, message: &ForceMessage, now_ns: u64, timeout_ns: u64) -> bool {
        let sent_ns = message.header.time_ns;
        let (old, future) = (now_ns.saturating_sub(sent_ns) > timeout_ns, sent_ns > now_ns);
        let [.., of_old, of_future] = &mut self.counts;
        *of_old += u64::from(old);
        *of_future += u64::from(future);
        !old && !future
    }

    /// What the port has passed over so far.
    pub fn hear(&mut self, rejected: Rejected) {
        let Rejected { schema, older_source, repeated, damaged } = rejected;
        let [of_schema, of_damaged, of_older, of_repeated, ..] = &mut self.counts;
        (*of_schema, *of_damaged, *of_older, *of_repeated) = (schema, damaged, older_source, repeated);
        for ((count, told), why) in self.counts.iter().zip(&mut self.told).zip(REASONS) {
            if *count > 0 && !*told {
                warn!("not believed: a force {why}");
                *told = true;
            }
        }
    }

    /// At the end: how many of each kind.
    pub fn tell_all(&self) {
        for (count, why) in self.counts.iter().zip(REASONS).filter(|(count, _)| **count > 0) {
            warn!(count, "not believed in all: forces {why}");
        }
    }
}
