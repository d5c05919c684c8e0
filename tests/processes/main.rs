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

#[macro_use]
extern crate macro_rules_attribute;

#[macro_use]
mod support;
mod test_threads;

mod alone;
mod always_stops;
mod calibrate;
mod confirmed_legs;
mod control_socket;
mod doctor;
mod doubted;
mod excite;
mod frames;
mod guides;
mod hosted;
mod identify;
mod in_force;
mod killed;
mod locked_memory;
mod lockstep;
mod orderly_stop;
mod other_poses;
mod other_users;
mod other_version;
mod overruns;
mod panels;
mod paused;
mod players;
mod readme;
mod recordings;
mod refusals;
mod reload;
mod remains;
mod remarks;
mod requests;
mod rounds;
mod stale;
mod stops_supersede;
mod target_table;
mod targets;
mod trajectory;
mod two_sources;
mod udp;
mod view;
mod wrong_senders;
