//! An adversary: it searches for messages, requests, rates, machines and worlds that move the platform beyond a limit.
//!
//! `hexad_support::search` has the search and the list of properties. `HEXAD_LONG=1` searches for 1e6 cycles under control of each
//! machine with each policy, `HEXAD_LONG=5` for five times as many, `HEXAD_SEARCH_SECONDS=60` for as long; `HEXAD_SEED` begins
//! elsewhere; `HEXAD_ADVERSARY_KEEP=FILE` writes the worst genomes, and `HEXAD_ADVERSARY_TRACE=FILE` with the test `trace` prints one run.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests"
)]

mod scorer;
mod tests;
mod trace;
