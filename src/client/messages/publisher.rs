//! Publishing one topic.

use iceoryx2::port::publisher::Publisher as Port;
use iceoryx2::prelude::ipc;

use super::bus::{PortError, port_error};
use super::clock::monotonic_ns;
use super::{Header, Message};

/// Publisher of one topic, which numbers its messages.
pub struct Publisher<T: Message> {
    port: Port<ipc::Service, T, ()>,
    epoch: Option<u64>,
    sequence: u64,
}

impl<T: Message> Publisher<T> {
    pub(super) fn new(port: Port<ipc::Service, T, ()>, epoch: u64) -> Self {
        Self { port, epoch: Some(epoch), sequence: 0 }
    }

    /// The same publisher with the time of its first message as the epoch: in simulated time its messages are then the
    /// same in each run.
    pub fn with_reproducible_epoch(self) -> Self {
        Self { epoch: None, ..self }
    }

    /// Begins the epoch now, before the first message. Under control a publisher counts only if it began after the
    /// last message of the previous one.
    pub fn begin_epoch(&mut self) {
        self.epoch = Some(monotonic_ns());
    }

    /// Fills in the header and sends. `time_ns` is the instant at which the content holds.
    pub fn publish(&mut self, time_ns: u64, mut message: T) -> Result<(), PortError> {
        self.sequence += 1;
        let epoch = *self.epoch.get_or_insert(time_ns);
        *message.header_mut() =
            Header { schema: T::SCHEMA, reserved: 0, epoch, sequence: self.sequence, time_ns };
        message.seal();
        let sample = self
            .port
            .loan_uninit()
            .map_err(|cause| port_error(format!("cannot loan {}", T::TOPIC))(cause))?;
        sample
            .write_payload(message)
            .send()
            .map(|_| ())
            .map_err(|cause| port_error(format!("cannot send {}", T::TOPIC))(cause))
    }
}
