//! The header of every message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;

message! {
    /// First field of every message; the publisher fills it in.
    Header = "hexad_header" {
        /// Version of the message: of its fields and their meaning.
        schema: u32,
        /// Zero.
        reserved: u32,
        /// Identifies one life of the publisher: its CLOCK_MONOTONIC start time. The latest life takes precedence; one
        /// that begins in the future is ignored.
        epoch: u64 ["ns"],
        /// Number of the message in this life, from 1.
        sequence: u64,
        /// CLOCK_MONOTONIC instant at which the content holds.
        time_ns: u64 ["ns"],
    }
}
