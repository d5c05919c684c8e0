//! The daemon over its topics.

use hexad_client::messages::{Bus, ForceMessage, MeasuredMessage, PortError, Publisher, Subscriber};

use crate::cycle::Daemon;

/// Ports of a driver.
pub struct Topics {
    measured: Publisher<MeasuredMessage>,
    forces: Subscriber<ForceMessage>,
    /// Error of the last publication.
    pub failure: Option<PortError>,
}

impl Topics {
    /// Joins the topics of a machine.
    pub fn join(name: &str) -> Result<Self, PortError> {
        let bus = Bus::join(name)?;
        Ok(Self { measured: bus.publisher()?, forces: bus.subscriber(8)?, failure: None })
    }
}

impl Daemon for Topics {
    fn publish(&mut self, stamp_ns: u64, measured: MeasuredMessage) {
        self.failure = self.measured.publish(stamp_ns, measured).err();
    }

    fn receive(&mut self, _: u64) -> Option<ForceMessage> {
        self.forces.receive_latest()
    }
}
