//! The driver against the simulated segment, in one process and on a simulated clock.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, reason = "tests")]

mod brakes;
mod closed_loop;
mod common;
mod failures;
mod files;
mod jog;
mod rig;
mod startup;
