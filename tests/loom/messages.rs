//! The clock, where `clock.rs` of the loop finds it.

#[path = "../../src/client/messages/clock.rs"]
pub mod clock;
