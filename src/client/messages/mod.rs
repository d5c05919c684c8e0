//! Messages on the topics `hexad/<name>/...` and the ports that publish and receive them: all that a driver needs.
//!
//! A message is a `#[repr(C)]` struct of plain numbers in SI units and radians. Each begins with a [`Header`]. iceoryx2
//! compares only name, size and alignment of a type, so the header carries the schema version of the message; a
//! subscriber rejects messages of another one.
//!
//! # In other languages
//!
//! `hexad messages --language c|python|json` prints the declarations of all structs. Numbers of 4 bytes come in pairs, so
//! that no compiler leaves gaps.
//!
//! | | |
//! | --- | --- |
//! | iceoryx2 | 0.9.3 exactly, publish-subscribe, IPC service, no user header |
//! | topic | `hexad/<name>/<last part>`: `setpoint`, `measured`, `force`, `status`, `statistics` |
//! | type name | `hexad_<last part>` |
//! | opening a service | open or create: the first participant sets the settings for all |
//! | settings, ports | `max_publishers` 4; `max_subscribers` 16; `max_nodes` 32 |
//! | settings, buffers | `subscriber_max_buffer_size` 256, safe overflow, `history_size` 0 |
//! | user | all participants of a machine run as one user |
//! | root path | `iceoryx2` in the folder of the user, mode 0700 |
//! | prefix | content of the file `prefix` in the folder of the user; hold `flock` on it while creating the node |
//! | signals | the daemon's node installs no handlers (`SignalHandlingMode::Disabled`) |
//!
//! The folder of the user has mode 0755. It is the first of these that belongs to the user:
//!
//! 1. `/run/hexad`
//! 2. `/run/hexad-root` for root, `/tmp/hexad-<user ID>` for others
//! 3. the first of `/tmp/hexad-<user ID>-*`
//!
//! A publisher fills in the header and numbers its messages from 1. A subscriber accepts a message of its schema that is
//! intact and follows all before in the order of (epoch, sequence): the last message of a publisher that died may still
//! arrive.
//!
//! Requests go over the control socket (`docs/operator.md`).
//!
//! # In simulated time
//!
//! With `realtime.release = "lockstep"` the topics are `hexad-simulated/<name>/...`. All times are those of the plant, which may
//! begin at any instant; the epoch of `force` is the time of its first message. In each step the plant publishes `measured` of an
//! instant; the setpoint source responds with `setpoint` of that `time_ns`, after the daemon has posted its request for that cycle
//! if there is one; the daemon publishes `status`, then `force`, with that instant as `time_ns` and `release_ns`; the plant
//! simulates one period. A plant that receives no response repeats its message, and a source repeats its response: a participant
//! may not be connected yet. When the setpoint source has left, the daemon continues without setpoints.

use iceoryx2::prelude::ZeroCopySend;

mod bus;
pub mod cdr;
pub mod claim;
pub mod clock;
mod cycle;
mod force;
mod header;
pub mod layout;
mod lease;
pub mod location;
pub mod lockstep;
mod measured;
mod publisher;
mod rejection;
mod remains;
mod reservation;
mod setpoint;
pub mod source_clock;
mod statistics;
mod status;
mod subscriber;

pub use self::bus::{Bus, PortError, TopicObserver};
pub use self::claim::Claim;
pub use self::cycle::{CycleMessage, GapMessage};
pub use self::force::ForceMessage;
pub use self::header::Header;
pub use self::measured::MeasuredMessage;
pub use self::publisher::Publisher;
pub use self::rejection::Rejection;
pub use self::remains::Remains;
pub use self::setpoint::SetpointMessage;
pub use self::statistics::{
    IoCounters, LoopCounters, LoopTimes, RejectionCounts, StatisticsMessage, Times, WORST_CYCLES, WorstCycle,
};
pub use self::status::{DiagnosticRecord, StatusMessage};
pub use self::subscriber::{LeasedSubscriber, Subscriber};

use self::layout::{Declared, Layout};

/// Layouts of all messages.
pub const MESSAGES: [&Layout; 5] = [
    &SetpointMessage::LAYOUT,
    &MeasuredMessage::LAYOUT,
    &ForceMessage::LAYOUT,
    &StatusMessage::LAYOUT,
    &StatisticsMessage::LAYOUT,
];

/// A struct that is published on a topic of its own.
pub trait Message: Copy + core::fmt::Debug + ZeroCopySend + 'static {
    /// Last part of the topic's name.
    const TOPIC: &'static str;

    /// Version of the message. Any change of layout or meaning raises it, also of a struct that it contains.
    const SCHEMA: u32;

    /// Schema version, publisher, sequence number and time stamp of the message.
    fn header(&self) -> &Header;

    /// The header for the publisher to fill in.
    fn header_mut(&mut self) -> &mut Header;

    /// Fills in the checksum, if the message has one.
    fn seal(&mut self) {}

    /// Whether the checksum, if there is one, is that of the content.
    fn is_intact(&self) -> bool {
        true
    }
}
