//! Receiving one topic.

use iceoryx2::port::subscriber::Subscriber as Port;
use iceoryx2::prelude::ipc;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::bus::BUFFER;
use super::clock::monotonic_ns;
use super::{Message, RejectionCounts};

/// Subscriber of one topic, which gives precedence to the latest life of the publisher.
pub struct Subscriber<T: Message> {
    service: PortFactory<ipc::Service, T, ()>,
    port: Port<ipc::Service, T, ()>,
    is_simulated: bool,
    /// Epoch and sequence number of the last message that was accepted.
    last: (u64, u64),
    received: u64,
    rejected: RejectionCounts,
}

impl<T: Message> Subscriber<T> {
    /// Most messages that the buffers of all publishers hold: bounds the time of one call, however fast they publish.
    const MAX_PENDING: usize = T::MAX_PUBLISHERS * BUFFER;

    pub(super) fn new(
        service: PortFactory<ipc::Service, T, ()>,
        port: Port<ipc::Service, T, ()>,
        is_simulated: bool,
    ) -> Self {
        let rejected = RejectionCounts::default();
        Self { service, port, is_simulated, last: (0, 0), received: 0, rejected }
    }

    /// The next message in order, if any. Rejects other schemas, wrong checksums, older lives of the publisher and
    /// messages received before: after a publisher dies, its last message may still arrive.
    pub fn receive(&mut self) -> Option<T> {
        for _ in 0..Self::MAX_PENDING {
            let message = self.receive_unchecked()?;
            if self.accept(&message) {
                return Some(message);
            }
        }
        None
    }

    /// The next message of any publisher that is alive or was, each once: for messages none of which may be lost
    /// because another publisher began later.
    pub fn receive_from_any(&mut self) -> Option<T> {
        for _ in 0..Self::MAX_PENDING {
            let message = self.receive_unchecked()?;
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
    pub fn received_count(&self) -> u64 {
        self.received
    }

    /// Numbers of messages rejected.
    pub fn rejections(&self) -> RejectionCounts {
        self.rejected
    }

    fn receive_unchecked(&mut self) -> Option<T> {
        match self.port.receive() {
            Ok(sample) => sample.map(|sample| *sample.payload()),
            Err(_) => {
                self.rejected.repeated += 1;
                None
            }
        }
    }

    /// Counts the message as accepted, or as rejected by its first fault.
    fn accept(&mut self, message: &T) -> bool {
        let header = message.header();
        let order = (header.epoch, header.sequence);
        let (last_epoch, last_sequence) = self.last;
        // A life that begins in the future (another clock) would take precedence over all that begin later. In
        // simulated time it may begin at any instant.
        let has_begun = self.is_simulated || header.epoch <= monotonic_ns();
        let count = if header.schema != T::SCHEMA {
            &mut self.rejected.schema
        } else if !(message.is_intact() && has_begun) {
            &mut self.rejected.damaged
        } else if order > self.last {
            let same_life = header.epoch == last_epoch;
            self.received += if same_life { header.sequence - last_sequence } else { 1 };
            self.last = order;
            return true;
        } else if header.epoch < last_epoch {
            &mut self.rejected.older_publisher
        } else {
            &mut self.rejected.repeated
        };
        *count += 1;
        false
    }
}
