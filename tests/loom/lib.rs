//! Model checking of the exchange between the io thread and the real-time thread.
//!
//! loom runs the threads of a model in every order that the C11 memory model allows, with every stale value that a
//! load may return. It checks the daemon's own `triple_buffer.rs` and `event.rs`; only what they are built from is
//! replaced:
//!
//! - [`sync`]: loom's atomics, cells and shared ownership;
//! - [`futex`]: the comparison and the sleep are one step, as they are in the kernel, and a sleep ends only by a
//!   wake-up. A lost signal is then a deadlock, which loom reports.
//!
//! `cargo test --release --manifest-path tests/loom/Cargo.toml`: `exchange` checks the code as it is; `controls`
//! weaken it, one flaw at a time, and each flaw must be found.

#[path = "../../src/client/realtime/clock.rs"]
pub mod clock;
#[path = "../../src/client/realtime/event.rs"]
pub mod event;
pub mod flaw;
pub mod futex;
pub mod messages;
pub mod models;
pub mod sync;
#[path = "../../src/client/realtime/triple_buffer.rs"]
pub mod triple_buffer;
