//! Where methods fail: assembly modes, far starts, sizes, offsets, sampling. Each case has its predicted outcome.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

use crate::common;

mod beyond;
mod check;
mod dietmaier;
mod fichter;
mod gimbal;
mod legs;
mod passing;
mod random;
mod sampled;
mod sizes;
