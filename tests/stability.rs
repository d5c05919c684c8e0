//! Where methods fail: assembly modes, far starts, sizes, offsets, sampling. Each case has its predicted outcome.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod beyond;
mod check;
#[path = "../common/mod.rs"]
mod common;
mod delayed;
mod dietmaier;
mod fichter;
mod gimbal;
mod legs;
mod passing;
mod random;
#[path = "../common/rig.rs"]
mod rig;
mod rivals;
mod sampled;
mod sizes;
mod transition;
mod trials;
