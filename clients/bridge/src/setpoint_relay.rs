//! Setpoints of remote sources on the topic of the machine. Each life of a source is a life of a publisher: the daemon decides
//! whether it counts, and how the platform reacts to its end.

use std::collections::BTreeMap;
use std::fmt::Debug;

use hexad_client::messages::source_clock::{SourceClock, SourceInstant};
use hexad_client::messages::{Bus, PortError, Publisher, SetpointMessage};
use hexad_core::control::parameters::ViolationPolicy;
use hexad_core::control::signals::inputs::{Setpoint, SetpointKind};
use hexad_core::model::task::TaskState;
use hexad_machine::config::Config;
use tracing::info;

use crate::rejection::Rejection;

/// Number of sources whose clocks are kept. The one that was silent for longest is forgotten.
const MAX_SOURCES: usize = 16;

/// Most messages of a source in a second: twice the rate of a loop at 1 kHz.
const MAX_RATE_HZ: u64 = 2_000;

/// Messages that may arrive at once, after an interruption.
const BURST: u64 = 64;

/// Relay of one machine. `Id` identifies one life of a source.
pub struct SetpointRelay<'a, Id> {
    config: &'a Config,
    /// Silence after which a source has ended, and largest age of a message \[ns\].
    timeout_ns: u64,
    sources: BTreeMap<Id, Source>,
    /// Source that is followed.
    followed: Option<Id>,
    /// Newest setpoint that is not published yet.
    newest: Option<Setpoint>,
    /// Publisher of the life of the followed source.
    publisher: Option<(Publisher<SetpointMessage>, Bus)>,
}

/// Clock and rate of a source.
struct Source {
    clock: SourceClock,
    /// Arrival of its last accepted message \[ns\].
    seen_ns: u64,
    /// Instant from which on the next message is within [`MAX_RATE_HZ`] \[ns\].
    due_ns: u64,
}

impl<'a, Id: Ord + Clone + Debug> SetpointRelay<'a, Id> {
    /// Relay without a source.
    pub fn new(config: &'a Config) -> Self {
        let timeout_ns = (config.deployment.timeouts.setpoint_s * 1e9) as u64;
        Self { config, timeout_ns, sources: BTreeMap::new(), followed: None, newest: None, publisher: None }
    }

    /// Accepts a message with this stamp of the source's clock. `convert` returns the kind, the motion, and how long after the
    /// stamp it holds \[ns\].
    pub fn add(
        &mut self,
        id: &Id,
        stamp_ns: i64,
        arrival_ns: u64,
        convert: impl FnOnce() -> Result<(SetpointKind, TaskState, i64), Rejection>,
    ) -> Result<(), Rejection> {
        self.end_silent(arrival_ns);
        if let Some(followed) = self.followed.as_ref().filter(|followed| *followed != id) {
            return Err(Rejection::OtherSource(format!("{followed:?}")));
        }
        let (timeout_ns, policy) = (self.timeout_ns, self.config.deployment.setpoint.on_violation);
        let source = self.source(id, arrival_ns);
        let (due_ns, interval_ns) = (source.due_ns.max(arrival_ns), 1_000_000_000 / MAX_RATE_HZ);
        if due_ns - arrival_ns >= BURST * interval_ns {
            return Err(Rejection::Flood(MAX_RATE_HZ));
        }
        source.due_ns = due_ns + interval_ns;
        let (kind, task, ahead_ns) = convert()?;
        if !task.is_finite() {
            return Err(Rejection::NotFinite);
        }
        if kind == SetpointKind::Pose && policy != ViolationPolicy::Limit {
            return Err(Rejection::Policy);
        }
        if !(0..=timeout_ns as i64).contains(&ahead_ns) {
            return Err(Rejection::Ahead(ahead_ns as f64 * 1e-9, timeout_ns as f64 * 1e-6));
        }
        let SourceInstant { time_ns, rate_ratio } = source.clock.instant(stamp_ns, arrival_ns as i64)?;
        source.seen_ns = arrival_ns;
        let time_ns = time_ns.saturating_add((ahead_ns as f64 / rate_ratio) as i64) as u64;
        self.newest = Some(Setpoint { kind, ..Setpoint::motion(time_ns, task.at_rate(rate_ratio)) });
        if self.followed.replace(id.clone()).is_none() {
            let clock = self.config.deployment.setpoint.clock;
            info!(
                "follows the source {id:?}: setpoint.clock is {clock:?}, its clock runs at {rate_ratio:.3} of real time"
            );
        }
        Ok(())
    }

    /// Publishes the newest setpoint since the last call, if there is one.
    pub fn publish(&mut self, now_ns: u64) -> Result<(), PortError> {
        self.end_silent(now_ns);
        let Some(setpoint) = self.newest.take() else { return Ok(()) };
        let (publisher, _) = match &mut self.publisher {
            Some(publisher) => publisher,
            none => {
                let bus = self.config.join()?;
                none.insert((bus.publisher()?, bus))
            }
        };
        publisher.publish(setpoint.time_ns, (&setpoint).into())
    }

    /// Ends the life of the publisher if its source is silent.
    fn end_silent(&mut self, now_ns: u64) {
        let Some(followed) = &self.followed else { return };
        let source = self.sources.get(followed);
        if source.is_none_or(|source| now_ns.saturating_sub(source.seen_ns) > self.timeout_ns) {
            info!("the source {followed:?} has ended");
            (self.followed, self.newest, self.publisher) = (None, None, None);
        }
    }

    /// The source with this identity.
    fn source(&mut self, id: &Id, now_ns: u64) -> &mut Source {
        if self.sources.len() >= MAX_SOURCES && !self.sources.contains_key(id) {
            let silent = self.sources.iter().min_by_key(|(_, source)| source.seen_ns);
            silent.map(|(id, _)| id.clone()).and_then(|id| self.sources.remove(&id));
        }
        let clock = || SourceClock::new(self.config.deployment.setpoint.clock, self.timeout_ns as i64, false);
        let new = || Source { clock: clock(), seen_ns: now_ns, due_ns: 0 };
        self.sources.entry(id.clone()).or_insert_with(new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_client::messages::source_clock::NoInstant;

    const MS: u64 = 1_000_000;

    fn config(policy: &str) -> Config {
        let text = include_str!("../../../config/motion_base.toml");
        let sections = format!("\n[setpoint]\non_violation = \"{policy}\"\n[timeouts]\nsetpoint_ms = 100\n");
        Config::parse(&format!("{text}{sections}"), "a test").unwrap()
    }

    fn home(config: &Config) -> Result<(SetpointKind, TaskState, i64), Rejection> {
        Ok((SetpointKind::Pose, TaskState::at_rest(config.machine.home), 0))
    }

    /// Rejections of poses at home, each with its source, stamp of the source's clock and arrival \[ms\].
    fn rejections(messages: &[(u8, u64, u64)]) -> Vec<Option<Rejection>> {
        let config = config("limit");
        let mut relay = SetpointRelay::new(&config);
        let add = |(id, stamp_ms, arrival_ms): &(u8, u64, u64)| {
            relay.add(id, (stamp_ms * MS) as i64, arrival_ms * MS, || home(&config)).err()
        };
        messages.iter().map(add).collect()
    }

    #[test]
    fn a_message_later_than_the_stream_is_never_followed_whenever_it_arrives() {
        // Held up for 5 s, for longer than any source is silent.
        let messages =
            [(1, 1000, 9000), (1, 1010, 9010), (1, 1020, 14_020), (1, 1030, 17_000), (1, 9_100, 17_100)];
        let found = rejections(&messages);
        let late = Some(Rejection::Clock(NoInstant::Late(100.0)));
        assert_eq!(found, [None, None, late.clone(), late, None]);
    }

    #[test]
    fn one_source_is_followed_until_it_is_silent() {
        let found = rejections(&[(1, 10, 9000), (2, 10, 9050), (1, 60, 9060), (2, 20, 9200), (1, 200, 9210)]);
        let is_other = |found: &Option<Rejection>| matches!(found, Some(Rejection::OtherSource(_)));
        assert_eq!(found.iter().map(is_other).collect::<Vec<_>>(), [false, true, false, false, true]);
    }

    #[test]
    fn a_flood_is_thinned_and_what_no_setpoint_may_be_is_named() {
        let limit = config("limit");
        let mut relay = SetpointRelay::new(&limit);
        let mut add = |k, stamp_ns| relay.add(&1, stamp_ns, 9000 * MS + k, || home(&limit));
        // 10,000 messages a second, for one second.
        let found: Vec<_> = (0..10_000).map(|k| add(k * MS / 10, (k * MS / 10) as i64)).collect();
        let accepted = found.iter().filter(|found| found.is_ok()).count() as u64;
        assert!((MAX_RATE_HZ..MAX_RATE_HZ + BURST + 1).contains(&accepted), "{accepted}");
        assert!(found.iter().rev().take(10).any(Result::is_ok), "none is silent");
        assert!(found.contains(&Err(Rejection::Flood(MAX_RATE_HZ))));

        let stop = config("stop");
        let mut relay = SetpointRelay::new(&stop);
        let mut add = |kind, task, ahead_ns| relay.add(&1, 1, 9000 * MS, || Ok((kind, task, ahead_ns)));
        let task = TaskState::at_rest(stop.machine.home);
        assert_eq!(add(SetpointKind::Pose, task, 0), Err(Rejection::Policy));
        let later = (101 * MS) as i64;
        assert_eq!(add(SetpointKind::Motion, task, later), Err(Rejection::Ahead(0.101, 100.0)));
        assert_eq!(
            add(SetpointKind::Motion, TaskState::at_rest([f64::NAN; 6]), 0),
            Err(Rejection::NotFinite)
        );
        assert_eq!(add(SetpointKind::Motion, task, 0), Ok(()));
    }
}
