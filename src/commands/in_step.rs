//! Requests in step with setpoints, over the topic `command`. In simulated time such a request belongs to an
//! instant.
//!
//! Operators use the control socket ([`hexad_client::operator`]).

use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{Bus, CommandMessage, PortError, Publisher, StatusMessage, Subscriber};
use hexad_core::control::signals::state::Request;

/// Sender of requests in step, with the daemon's status.
pub struct Operator {
    commands: Publisher<CommandMessage>,
    statuses: Subscriber<StatusMessage>,
    is_simulated: bool,
    /// Time of the newest status \[ns\]; in simulated time, the present.
    status_ns: u64,
}

impl Operator {
    /// Joins the topics of a machine.
    pub fn new(bus: &Bus) -> Result<Self, PortError> {
        let (commands, statuses) = (bus.publisher()?, bus.subscriber(8)?);
        Ok(Self { commands, statuses, is_simulated: bus.is_simulated(), status_ns: 0 })
    }

    /// Sends a request without waiting for its result.
    pub fn send(&mut self, request: Request) -> Result<(), PortError> {
        let now_ns = if self.is_simulated { self.status_ns } else { monotonic_ns() };
        self.commands.publish(now_ns, request.into())
    }

    /// The newest status, if one arrived since the last call.
    pub fn status(&mut self) -> Option<StatusMessage> {
        let status = self.statuses.receive_latest();
        self.status_ns = status.map_or(self.status_ns, |status| status.header.time_ns);
        status
    }
}
