//! The command message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;
use crate::control::state::{OperatorRequest, Request};

message! {
    /// Operator request, one per message.
    CommandMessage = "hexad_command" on "command" schema 5 {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// Number of the `Request`.
        request: u32,
        /// Zero.
        reserved: u32,
    }
}

impl From<Request> for CommandMessage {
    fn from(request: Request) -> Self {
        Self { request: request as u32, ..Self::default() }
    }
}

impl CommandMessage {
    /// The request with the message's epoch and sequence number; `None` if no request has its number.
    pub fn request(&self) -> Option<OperatorRequest> {
        let request = Request::from_number(self.request)?;
        Some(OperatorRequest { request, message: (self.header.epoch, self.header.sequence) })
    }
}
