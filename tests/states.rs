//! The state machine: every transition there is, and every way through the whole controller.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod every_transition;
mod oracle;
mod sequences;
