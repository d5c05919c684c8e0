//! The clock, where `clock.rs` of the loop finds it.

#[path = "../../src/messages/clock.rs"]
pub mod clock;
