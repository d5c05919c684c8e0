//! A daemon that the test plays: force messages with whatever is wrong with them.

use std::cell::Cell;

use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, Publisher};
use hexad::messages::{ForceMessage, Header, Message};
use iceoryx2::prelude::ZeroCopySend;

/// What is done to a message after it was sealed.
pub type Change = fn(&mut ForceMessage);

thread_local! {
    static CHANGE: Cell<Change> = const { Cell::new(|_| {}) };
}

/// On the bus it is a force message.
#[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
#[type_name("hexad_force")]
#[repr(C)]
struct Forged(ForceMessage);

impl Message for Forged {
    const TOPIC: &'static str = ForceMessage::TOPIC;
    const SCHEMA: u32 = ForceMessage::SCHEMA;
    fn header(&self) -> &Header {
        self.0.header()
    }
    fn header_mut(&mut self) -> &mut Header {
        self.0.header_mut()
    }
    fn seal(&mut self) {
        self.0.seal();
        CHANGE.get()(&mut self.0);
    }
}

/// Who sends them.
pub struct Forger {
    source: Publisher<Forged>,
    force_n: [f64; 6],
}

impl Forger {
    /// Sends these forces as those of an active daemon.
    pub fn new(bus: &Bus, force_n: [f64; 6]) -> Self {
        Self { source: bus.publisher().expect("to publish"), force_n }
    }

    /// Sends one, changed.
    pub fn send(&mut self, change: Change) {
        CHANGE.set(change);
        let message = ForceMessage {
            force_n: self.force_n,
            valid: 1,
            state: State::Active as u32,
            ..Default::default()
        };
        self.source.publish(monotonic_ns(), Forged(message)).expect("to send");
    }
}
