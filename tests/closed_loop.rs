//! Controller and simulated platform in one loop, in simulated time: tracking, replay, faults.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod built_in;
#[path = "../common/mod.rs"]
mod common;
mod evidence;
mod inputs;
mod limits;
mod modes;
mod observer;
mod poses;
mod replay;
#[path = "../common/rig.rs"]
mod rig;
mod rungs;
mod tracking;
