//! The command `hexad` as it is used: real processes over real shared memory with real signals.
//!
//! The host may take the processor away for many milliseconds. No test asserts an absolute time but for
//! generous limits against hanging; timeouts are long where they are not what is tested; what is counted is
//! compared with what the messages themselves say.
//!
//! `HEXAD_LONG=1` runs the tests of locked memory and of peers that die for a minute each, and 500 rounds of
//! kills; `HEXAD_SEED` repeats the rounds of a run.

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

mod always_stops;
mod churn;
mod command_line;
mod control_socket;
mod demo;
mod doctor;
mod doubted;
mod drive_delay;
mod estop_trials;
mod examined;
mod external;
mod fidelity;
mod hosted;
mod hybrid;
mod in_force;
mod killed;
mod locked_memory;
mod lockstep;
mod modes;
mod orderly_stop;
mod other_version;
mod overruns;
mod pages;
mod paused;
mod players;
mod readme;
mod recordings;
mod refusals;
mod released;
mod reload;
mod remains;
mod requests;
mod rounds;
mod stale;
mod system_calls;
mod tables;
mod targets;
mod trajectory;
mod two_sources;
mod unprivileged;
mod wrong_senders;
