//! Threads, time and the cyclic loop. `unsafe` is allowed here for system calls, each with its argument.
//!
//! The real-time path is [`cyclic::run`]: after start-up no allocation, no lock, no system call but the
//! sleep. [`allocation`] counts, so that this is a measurement and not a promise.
#![allow(unsafe_code, reason = "system calls and the allocator; each block carries its argument")]

pub mod allocation;
pub mod clock;
pub mod clock_cost;
pub mod cyclic;
pub mod doorbell;
pub mod overrun;
pub mod process;
pub mod setup;
pub mod usage;
pub mod waiter;
