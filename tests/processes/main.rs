//! The command `hexad` as it is used: real processes over real shared memory with real signals.
//!
//! The host may take the processor away for many milliseconds. No test asserts an absolute time but for
//! generous limits against hanging; timeouts are long where they are not what is tested; what is counted is
//! compared with what the messages themselves say.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "a failed assertion is how a test speaks"
)]
#![allow(clippy::std_instead_of_core, reason = "tests of processes have an operating system")]

#[path = "../common/mod.rs"]
mod common;
mod support;
mod test_threads;

mod alone;
mod always_stops;
mod command_line;
mod control_socket;
mod doctor;
mod doubted;
mod examined;
mod excite;
mod fidelity;
mod frames;
mod guides;
mod hosted;
mod identify;
mod in_force;
mod killed;
mod locked_memory;
mod lockstep;
mod modes;
mod orderly_stop;
mod other_users;
mod other_version;
mod overruns;
mod pages;
mod panels;
mod paused;
mod players;
mod readme;
mod recordings;
mod refusals;
mod released;
mod reload;
mod remains;
mod requests;
mod rotations;
mod rounds;
mod stale;
mod tables;
mod targets;
mod trajectory;
mod two_sources;
mod udp;
mod wrong_senders;
