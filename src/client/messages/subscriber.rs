//! Receiving one topic.

use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::port::subscriber::Subscriber as Port;
use iceoryx2::prelude::{CallbackProgression, ipc};
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use nix::errno::Errno;
use nix::sys::signal::kill;
use nix::unistd::Pid;

use super::bus::BUFFERED_MESSAGES;
use super::clock::monotonic_ns;
use super::lease::{Arrival, Lease, MAX_PUBLISHERS};
use super::{Message, Rejection, RejectionCounts};
use hexad_core::control::signals::inputs::Publishers;

/// Subscriber of one topic, which gives precedence to the latest life of the publisher.
pub struct Subscriber<T: Message> {
    service: PortFactory<ipc::Service, T, ()>,
    port: Port<ipc::Service, T, ()>,
    is_simulated: bool,
    /// Epoch and sequence number of the last message that was accepted.
    last: (u64, u64),
    received: u64,
    rejected: RejectionCounts,
    /// The last mistake of a sender.
    last_rejection: Option<Rejection>,
}

impl<T: Message> Subscriber<T> {
    /// Most messages that the buffers of all publishers hold: bounds the time of one call, however fast they publish.
    const MAX_PENDING: usize = MAX_PUBLISHERS * BUFFERED_MESSAGES;

    pub(super) fn new(
        service: PortFactory<ipc::Service, T, ()>,
        port: Port<ipc::Service, T, ()>,
        is_simulated: bool,
    ) -> Self {
        let rejected = RejectionCounts::default();
        Self { service, port, is_simulated, last: (0, 0), received: 0, rejected, last_rejection: None }
    }

    /// The next message in order, if any. Rejects other schemas, wrong checksums, older lives of the publisher and
    /// messages received before: after a publisher dies, its last message may still arrive.
    pub fn receive(&mut self) -> Option<T> {
        for _ in 0..Self::MAX_PENDING {
            let (message, _) = self.receive_unchecked()?;
            if self.check(&message) && self.accept(&message) {
                return Some(message);
            }
        }
        None
    }

    /// The next message of any publisher that is alive or was, each once: for messages none of which may be lost
    /// because another publisher began later.
    pub fn receive_from_any(&mut self) -> Option<T> {
        for _ in 0..Self::MAX_PENDING {
            let (message, _) = self.receive_unchecked()?;
            if message.header().schema == T::SCHEMA {
                return Some(message);
            }
            self.rejected.schema += 1;
        }
        None
    }

    /// The newest message that arrived since the last call, if any.
    pub fn receive_latest(&mut self) -> Option<T> {
        let mut latest = None;
        for _ in 0..Self::MAX_PENDING {
            match self.receive() {
                Some(message) => latest = Some(message),
                None => break,
            }
        }
        latest
    }

    /// Number of publishers now. A killed one counts until a participant notices its end.
    pub fn publisher_count(&self) -> usize {
        self.service.dynamic_config().number_of_publishers()
    }

    /// Number of messages: those accepted, and those that the publisher numbered in between and that found the buffer
    /// full.
    pub fn accepted_or_lost_count(&self) -> u64 {
        self.received
    }

    /// Numbers of messages rejected.
    pub fn rejections(&self) -> RejectionCounts {
        self.rejected
    }

    /// The last message that was rejected for a mistake of its sender.
    pub fn last_rejection(&self) -> Option<Rejection> {
        self.last_rejection
    }

    fn receive_unchecked(&mut self) -> Option<(T, UniquePublisherId)> {
        match self.port.receive() {
            Ok(sample) => sample.map(|sample| (*sample.payload(), sample.origin())),
            Err(_) => {
                self.rejected.repeated += 1;
                None
            }
        }
    }

    /// Whether a message can be read at all. Counts one that cannot.
    fn check(&mut self, message: &T) -> bool {
        let header = message.header();
        // A life that begins in the future (another clock) would take precedence over all that begin later. In
        // simulated time it may begin at any instant.
        let ahead_ns = if self.is_simulated { 0 } else { header.epoch.saturating_sub(monotonic_ns()) };
        let count = if header.schema != T::SCHEMA {
            self.last_rejection = Some(Rejection::Schema { found: header.schema, expected: T::SCHEMA });
            &mut self.rejected.schema
        } else if !message.is_intact() {
            &mut self.rejected.damaged
        } else if ahead_ns > 0 {
            self.last_rejection = Some(Rejection::Clock { ahead_ns });
            &mut self.rejected.damaged
        } else {
            return true;
        };
        *count += 1;
        false
    }

    /// Counts the message as accepted, or as rejected by its order.
    fn accept(&mut self, message: &T) -> bool {
        let header = message.header();
        let order = (header.epoch, header.sequence);
        let (last_epoch, last_sequence) = self.last;
        if order > self.last {
            let same_life = header.epoch == last_epoch;
            self.received += if same_life { header.sequence - last_sequence } else { 1 };
            self.last = order;
            return true;
        }
        let count = if header.epoch < last_epoch {
            &mut self.rejected.other_publisher
        } else {
            &mut self.rejected.repeated
        };
        *count += 1;
        false
    }

    fn is_listed(&self, id: UniquePublisherId) -> bool {
        process_of(&self.service, id).is_some()
    }
}

/// Process of a publisher, if it is there. A killed one is until a participant notices its end.
fn process_of<T: Message>(service: &PortFactory<ipc::Service, T, ()>, id: UniquePublisherId) -> Option<u32> {
    let mut found = None;
    service.dynamic_config().list_publishers(|details| {
        if details.publisher_id != id {
            return CallbackProgression::Continue;
        }
        found = u32::try_from(details.node_id.pid().value()).ok();
        CallbackProgression::Stop
    });
    found
}

/// Subscriber of one topic on which one publisher counts at a time, see `src/messages/lease.rs`.
pub struct LeasedSubscriber<T: Message> {
    subscriber: Subscriber<T>,
    lease: Lease<UniquePublisherId>,
}

impl<T: Message> LeasedSubscriber<T> {
    /// A publisher has left after a silence of `timeout_ns`.
    pub(super) fn new(subscriber: Subscriber<T>, timeout_ns: u64) -> Self {
        Self { subscriber, lease: Lease::new(timeout_ns) }
    }

    /// Changes the silence after which a publisher has left \[ns\].
    pub fn set_silence_timeout_ns(&mut self, timeout_ns: u64) {
        self.lease.set_silence_timeout_ns(timeout_ns);
    }

    /// The newest message of the publisher that counts, if one arrived since the last call.
    pub fn receive_latest(&mut self, has_control: bool) -> Option<T> {
        // All of them before the decision: after a pause of this process all publishers were silent alike.
        let mut arrived = [const { None }; MAX_PUBLISHERS];
        for _ in 0..Subscriber::<T>::MAX_PENDING {
            let Some((place, after, message)) = self.receive_any() else { break };
            if let Some((count, newest)) = arrived.get_mut(place).map(|slot| slot.get_or_insert((0, message)))
            {
                (*count, *newest) = (*count + after, message);
            }
        }
        let counting = self.decide(has_control);
        let mut latest = None;
        for (place, (count, message)) in
            arrived.into_iter().enumerate().filter_map(|(place, found)| Some((place, found?)))
        {
            if Some(place) == counting {
                self.subscriber.received += count;
                latest = Some(message);
            } else {
                self.subscriber.rejected.other_publisher += count;
            }
        }
        latest
    }

    /// The next message of the publisher that counts, in order.
    pub fn receive(&mut self, has_control: bool) -> Option<T> {
        for _ in 0..Subscriber::<T>::MAX_PENDING {
            let (place, after, message) = self.receive_any()?;
            if self.decide(has_control) == Some(place) {
                self.subscriber.received += after;
                return Some(message);
            }
            self.subscriber.rejected.other_publisher += after;
        }
        None
    }

    /// Processes of the publisher that counts and of another that lives beside it.
    pub fn publishers(&self) -> Publishers {
        self.lease.publishers(monotonic_ns(), |id| self.subscriber.is_listed(id))
    }

    /// The subscriber, for its counts.
    pub fn subscriber(&self) -> &Subscriber<T> {
        &self.subscriber
    }

    fn decide(&mut self, has_control: bool) -> Option<usize> {
        let Self { subscriber, lease } = self;
        // Of a container whose processes are not visible from here, none counts as living.
        let has_ended = |process: u32| {
            process == 0
                || i32::try_from(process).is_ok_and(|id| kill(Pid::from_raw(id), None) == Err(Errno::ESRCH))
        };
        lease.choose_holder(monotonic_ns(), has_control, |id| subscriber.is_listed(id), has_ended)
    }

    /// The next message of any publisher that follows its last one: the publisher's place, by how many, and the message.
    fn receive_any(&mut self) -> Option<(usize, u64, T)> {
        let Self { subscriber, lease } = self;
        for _ in 0..Subscriber::<T>::MAX_PENDING {
            let (message, id) = subscriber.receive_unchecked()?;
            if !subscriber.check(&message) {
                continue;
            }
            let process = || process_of(&subscriber.service, id).unwrap_or_default();
            match lease.record(&message, id, process, monotonic_ns()) {
                Arrival::New { place, after } => return Some((place, after, message)),
                Arrival::Repeated => subscriber.rejected.repeated += 1,
            }
        }
        None
    }
}
