//! Faults in every state, in closed loop with the simulated platform: what the daemon does about each, and
//! what the platform feels.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod cells;
mod curves;
mod disturbances;
mod pictures;
mod recording;
mod rows;
mod scenarios;
mod sequences;
mod situations;
mod table;
mod world;
