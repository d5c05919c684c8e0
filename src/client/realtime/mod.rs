//! Threads, time and the cyclic loop. `unsafe` is allowed here for system calls, each with its argument.
//!
//! The real-time path is [`cyclic::run`]: after start-up no allocation, no lock, no system call but the
//! sleep. [`allocation`] counts, so that this is a measurement and not a promise.
//!
//! Nothing in it can panic either, which is proved, not measured: `tests/no_panic` follows every call and
//! jump from the loop through the machine code of the release build, for every instruction set, and finds only
//! time, arithmetic and the sleep. [`triple_buffer`], [`event`] and the record queue of [`cyclic`] replace packages with
//! checks that the compiler could not remove.
#![allow(unsafe_code, reason = "system calls and the allocator; each block carries its argument")]

pub mod allocation;
pub mod clock;
pub mod clock_cost;
pub mod cyclic;
pub mod event;
pub mod exchange;
pub mod file_passing;
pub mod futex;
pub mod overrun;
pub mod pause_signals;
pub mod process;
pub mod request_signal;
pub mod request_word;
pub mod setup;
pub mod stop_request;
pub mod sync;
pub mod triple_buffer;
pub mod usage;
pub mod waiter;
