//! Lease of a topic: one of several living publishers counts, and it counts until it has left.
//!
//! A publisher lives while its messages arrive and iceoryx2 lists it. Under control, only a publisher that
//! began after the last message of the previous one can succeed it. So one that published beside it all the
//! time never takes over by itself. Nor do sources that open a publisher for each message take turns: while the process of the last
//! one lives, another process has to wait until it has been silent. Without control any living publisher can count; the one that began
//! last is preferred.

use super::Message;
use hexad_core::control::signals::inputs::Publishers;

/// Most publishers of a topic at once, all of which are remembered: one life is meant; one more may be stopped (SIGSTOP) or dying, two are
/// reserve.
pub(super) const MAX_PUBLISHERS: usize = 4;

/// Publisher of a topic, by its messages.
#[derive(Clone, Copy, Debug)]
struct Known<Id> {
    id: Id,
    epoch: u64,
    sequence: u64,
    process_id: u32,
    /// Instant at which its last message was received \[ns\].
    seen_ns: u64,
}

/// Lease of one topic.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lease<Id> {
    known: [Option<Known<Id>>; MAX_PUBLISHERS],
    /// Epoch of the publisher that counts.
    holder: Option<u64>,
    /// Silence after which a publisher has left \[ns\].
    timeout_ns: u64,
}

/// Relation of a message to the earlier ones of its publisher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// The number of messages since the last one, and the place of the publisher.
    New { place: usize, after: u64 },
    /// The message was received before.
    Repeated,
}

impl<Id: Copy> Lease<Id> {
    /// Lease without a publisher.
    pub fn new(timeout_ns: u64) -> Self {
        Self { known: [None; MAX_PUBLISHERS], holder: None, timeout_ns }
    }

    /// Changes the silence after which a publisher has left \[ns\].
    pub fn set_silence_timeout_ns(&mut self, timeout_ns: u64) {
        self.timeout_ns = timeout_ns;
    }

    /// Records a message received now. `process_id` finds the process of a new publisher.
    pub fn record(
        &mut self,
        message: &impl Message,
        id: Id,
        process_id: impl FnOnce() -> u32,
        now_ns: u64,
    ) -> Arrival {
        let (epoch, sequence) = (message.header().epoch, message.header().sequence);
        for (place, known) in self.known.iter_mut().enumerate() {
            let Some(known) = known.as_mut().filter(|known| known.epoch == epoch) else { continue };
            if sequence <= known.sequence {
                return Arrival::Repeated;
            }
            let after = sequence - known.sequence;
            (known.id, known.sequence, known.seen_ns) = (id, sequence, now_ns);
            return Arrival::New { place, after };
        }
        let place = self.place_to_forget();
        let new = Known { id, epoch, sequence, process_id: process_id(), seen_ns: now_ns };
        if let Some(slot) = self.known.get_mut(place) {
            *slot = Some(new);
        }
        Arrival::New { place, after: 1 }
    }

    /// A free place, or the place of the publisher that was silent for longest and does not count.
    fn place_to_forget(&self) -> usize {
        let rank = |known: &Option<Known<Id>>| {
            known
                .as_ref()
                .map_or((0, 0), |known| (1 + u8::from(Some(known.epoch) == self.holder), known.seen_ns))
        };
        let places = self.known.iter().enumerate();
        places.min_by_key(|(_, known)| rank(known)).map_or(0, |(place, _)| place)
    }

    /// Decides which publisher counts. Returns its place.
    pub fn choose_holder(
        &mut self,
        now_ns: u64,
        has_control: bool,
        is_listed: impl Fn(Id) -> bool,
        has_ended: impl Fn(u32) -> bool,
    ) -> Option<usize> {
        let holder = self.holding();
        let others = self.others(now_ns).count();
        if others == 0 || holder.is_some_and(|holder| self.is_alive(holder, now_ns, &is_listed)) {
            return self.place(self.holder);
        }
        let may_follow = |next: &&Known<Id>| {
            let Some(holder) = holder.filter(|_| has_control) else { return true };
            let is_silent = now_ns.saturating_sub(holder.seen_ns) > self.timeout_ns;
            let has_left = || next.process_id == holder.process_id || has_ended(holder.process_id);
            next.epoch > holder.seen_ns && (is_silent || has_left())
        };
        let alive = self.others(now_ns).filter(|next| is_listed(next.id)).filter(may_follow);
        let next = alive.map(|next| next.epoch).max();
        self.holder = next.or(self.holder);
        self.place(self.holder)
    }

    /// Processes of the publisher that counts, and of another living one.
    pub fn publishers(&self, now_ns: u64, is_listed: impl Fn(Id) -> bool) -> Publishers {
        let used_pid = self.holding().map_or(0, |known| known.process_id);
        let mut others = self.others(now_ns).filter(|known| is_listed(known.id));
        Publishers { used_pid, ignored_pid_or_0: others.next().map_or(0, |known| known.process_id) }
    }

    fn place(&self, epoch: Option<u64>) -> Option<usize> {
        self.known
            .iter()
            .position(|known| known.as_ref().map(|known| known.epoch) == epoch && epoch.is_some())
    }

    fn holding(&self) -> Option<&Known<Id>> {
        self.known.iter().flatten().find(|known| Some(known.epoch) == self.holder)
    }

    /// Publishers that do not count and whose messages arrive.
    fn others(&self, now_ns: u64) -> impl Iterator<Item = &Known<Id>> {
        let is_recent = move |known: &&Known<Id>| {
            Some(known.epoch) != self.holder && now_ns.saturating_sub(known.seen_ns) <= self.timeout_ns
        };
        self.known.iter().flatten().filter(is_recent)
    }

    fn is_alive(&self, known: &Known<Id>, now_ns: u64, is_listed: impl Fn(Id) -> bool) -> bool {
        now_ns.saturating_sub(known.seen_ns) <= self.timeout_ns && is_listed(known.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::MeasuredMessage;

    const TIMEOUT_NS: u64 = 20;

    /// Publishers by their epochs; a process has ten times that number.
    struct Topic {
        lease: Lease<u64>,
        sequence: u64,
        left: Vec<u64>,
        /// Processes.
        ended: Vec<u32>,
    }

    impl Topic {
        fn new() -> Self {
            Self { lease: Lease::new(TIMEOUT_NS), sequence: 0, left: vec![], ended: vec![] }
        }

        /// Epoch of the publisher that counts after messages of these.
        fn at(&mut self, now_ns: u64, has_control: bool, epochs: &[u64]) -> u64 {
            for epoch in epochs {
                self.sequence += 1;
                let mut message = MeasuredMessage::default();
                (message.header.epoch, message.header.sequence) = (*epoch, self.sequence);
                let found = self.lease.record(&message, *epoch, || *epoch as u32 * 10, now_ns);
                assert!(matches!(found, Arrival::New { .. }));
            }
            let Self { lease, left, ended, .. } = self;
            lease.choose_holder(
                now_ns,
                has_control,
                |id| !left.contains(&id),
                |process| ended.contains(&process),
            );
            lease.holder.unwrap_or_default()
        }

        fn publishers(&self, now_ns: u64) -> [u32; 2] {
            let Publishers { used_pid, ignored_pid_or_0 } =
                self.lease.publishers(now_ns, |id| !self.left.contains(&id));
            [used_pid, ignored_pid_or_0]
        }
    }

    #[test]
    fn a_second_publisher_never_counts_while_the_first_lives() {
        for has_control in [false, true] {
            let mut topic = Topic::new();
            assert_eq!(topic.at(100, false, &[1]), 1);
            assert_eq!(topic.publishers(100), [10, 0]);
            for now_ns in 101..200 {
                assert_eq!(topic.at(now_ns, has_control, &[2, 1]), 1);
                assert_eq!(topic.publishers(now_ns), [10, 20]);
            }
            assert_eq!(topic.at(200 + TIMEOUT_NS, has_control, &[1]), 1);
            assert_eq!(topic.publishers(200 + TIMEOUT_NS), [10, 0], "the second is silent");
        }
    }

    #[test]
    fn after_one_has_left_the_other_counts_and_under_control_only_if_it_began_later() {
        for has_left in [false, true] {
            let mut topic = Topic::new();
            assert_eq!(topic.at(100, false, &[1, 2]), 2, "the one that began last");
            assert_eq!(topic.at(110, false, &[1, 2]), 2);
            topic.left.extend(has_left.then_some(2));
            topic.ended.extend(has_left.then_some(20));
            let after = if has_left { 111 } else { 111 + TIMEOUT_NS };
            assert_eq!(topic.at(after, true, &[1]), 2, "it was there all the time");
            let epoch = if has_left { 111 } else { 112 };
            let mut restarted = Topic { left: topic.left.clone(), ended: topic.ended.clone(), ..topic };
            assert_eq!(restarted.at(after, true, &[1, epoch]), epoch, "it has just begun");
            let mut topic = Topic { lease: restarted.lease, left: vec![2, epoch], ..restarted };
            assert_eq!(topic.at(after, false, &[1]), 1, "without control");
        }
    }

    /// Epochs of two processes that open a publisher for each message; tens are processes.
    #[test]
    fn two_processes_with_a_publisher_for_each_message_do_not_take_turns() {
        let mut topic = Topic::new();
        let sent = |topic: &mut Topic, now_ns: u64, process: u32| {
            let mut message = MeasuredMessage::default();
            (message.header.epoch, message.header.sequence) = (now_ns, 1);
            topic.lease.record(&message, now_ns, || process, now_ns);
            let Topic { lease, ended, .. } = topic;
            let place = lease
                .choose_holder(now_ns, true, |id| id == now_ns, |process| ended.contains(&process))
                .unwrap();
            lease.known[place].unwrap().process_id
        };
        for now_ns in (100..200).step_by(4) {
            assert_eq!([sent(&mut topic, now_ns, 1), sent(&mut topic, now_ns + 2, 2)], [1, 1]);
        }
        topic.ended.push(1);
        assert_eq!(sent(&mut topic, 200, 2), 2, "the first process has ended");
        assert_eq!(sent(&mut topic, 201 + TIMEOUT_NS, 3), 3, "the second is silent");
    }

    #[test]
    fn the_publisher_that_counts_is_never_forgotten_and_a_repeated_message_is_nothing() {
        let mut topic = Topic::new();
        assert_eq!(topic.at(100, false, &[1]), 1);
        for epoch in 1..=10 {
            assert_eq!(topic.at(100 + epoch, true, &[1, epoch + 1]), 1);
        }
        let mut message = MeasuredMessage::default();
        (message.header.epoch, message.header.sequence) = (1, topic.sequence - 1);
        let found = topic.lease.record(&message, 1, || 0, 200);
        assert_eq!(found, Arrival::Repeated);
    }
}
