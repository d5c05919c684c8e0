//! An adversary: it searches for messages, requests, rates and machines that move the platform beyond a limit.
//!
//! A genome describes a run of the controller against the plant with exactly the model's parameters. Each run is scored
//! by the true motion of the platform. The search begins with the worst runs that were ever found, goes on with random ones
//! and climbs from the best of each quantity.
//!
//! `HEXAD_LONG=1` searches for 1e6 cycles under control of each machine with each policy, `HEXAD_LONG=5` for five times as many;
//! `HEXAD_SEED` begins elsewhere; `HEXAD_ADVERSARY_KEEP=FILE` writes the worst genomes, and `HEXAD_ADVERSARY_TRACE` with the test
//! `trace` prints one run.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests"
)]

use crate::common;

mod genome;
mod machines;
mod messages;
mod run;
mod scenario;
mod scorer;
mod search;
mod stream;
mod table;
mod tests;
mod trace;
