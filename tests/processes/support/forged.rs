//! Messages with whatever is wrong with them, and a daemon that the test plays.

use std::cell::Cell;

use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, ForceMessage, Header, MeasuredMessage, Message, Publisher};
use iceoryx2::prelude::ZeroCopySend;

/// A module with a message that has this name on the bus, and the change of this thread to it after it was sealed.
macro_rules! forged {
    ($module:ident, $message:ty, $name:tt) => {
        pub mod $module {
            use super::*;

            thread_local! {
                pub static CHANGE: Cell<fn(&mut $message)> = const { Cell::new(|_| {}) };
            }

            #[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
            #[type_name($name)]
            #[repr(C)]
            pub struct Forged(pub $message);

            impl Message for Forged {
                const TOPIC: &'static str = <$message>::TOPIC;
                const SCHEMA: u32 = <$message>::SCHEMA;
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
        }
    };
}

forged!(force, ForceMessage, "hexad_force");
forged!(measured, MeasuredMessage, "hexad_measured");
// Not a message of hexad.
forged!(other_type, MeasuredMessage, "my_measured");

/// What is done to a force message.
pub type Change = fn(&mut ForceMessage);

/// Who sends them.
pub struct Forger {
    source: Publisher<force::Forged>,
    force_n: [f64; 6],
}

impl Forger {
    /// Sends these forces as those of an active daemon.
    pub fn new(bus: &Bus, force_n: [f64; 6]) -> Self {
        Self { source: bus.publisher().expect("to publish"), force_n }
    }

    /// Sends one, changed.
    pub fn send(&mut self, change: Change) {
        force::CHANGE.set(change);
        let message = ForceMessage {
            force_n: self.force_n,
            valid: 1,
            state: State::Active as u32,
            ..Default::default()
        };
        self.source.publish(monotonic_ns(), force::Forged(message)).expect("to send");
    }
}
