//! What a platform is asked to do over time: profiles, built-in motions, trajectories. No allocation, no I/O, no clock.
//!
//! Not here: limits of a deployment, which [`crate::control`] keeps.

pub mod built_in;
pub mod minimum_jerk;
pub mod timeline;
pub mod trajectory;
