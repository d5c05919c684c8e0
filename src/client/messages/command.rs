//! The command message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;
use hexad_core::control::signals::state::{MessageId, OperatorRequest, Request};

message! {
    /// Request of a program that sends it in step with its setpoints, one per message. Operators use the control socket.
    CommandMessage = "hexad_command" on "command" schema 5 publishers 16 {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// Number of the `Request`.
        request: u32,
        /// Zero.
        reserved: u32,
    }
}

/// Largest age of a request that may begin control \[ns\]. The sender of an older one has long stopped
/// waiting.
pub const MAX_REQUEST_AGE_NS: u64 = 1_000_000_000;

impl From<Request> for CommandMessage {
    fn from(request: Request) -> Self {
        Self { request: request as u32, ..Self::default() }
    }
}

impl CommandMessage {
    /// The request with the message's epoch and sequence number; `None` if no request has its number.
    pub fn request(&self) -> Option<OperatorRequest> {
        let request = Request::from_number(self.request)?;
        Some(OperatorRequest {
            request,
            message: MessageId { epoch: self.header.epoch, sequence: self.header.sequence },
        })
    }
}
