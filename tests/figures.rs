//! Drawing of the benches' charts: numbers of the axes, ranges, fronts.

#![allow(dead_code, clippy::unwrap_used, reason = "a part of the benches, of which only its tests are run")]

#[path = "../benches/support/log_axis.rs"]
mod log_axis;
#[path = "../benches/support/scatter.rs"]
mod scatter;
