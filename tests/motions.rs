//! One rule for every motion, seen from outside: whatever is asked of the controller, the true motion of the platform
//! keeps every limit. Each file is a way in which a motion may leave them.
//!
//! The plant has exactly the parameters of the model, so what is beyond a limit was commanded.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod beyond_the_envelope;
mod engage_in_motion;
mod frozen_sensors;
mod heave;
mod lost_source;
mod old_measurements;
mod old_setpoints;
mod released_in_motion;
mod replaced_source;
mod report;
mod wrong_derivatives;
