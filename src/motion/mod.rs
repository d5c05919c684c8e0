//! Motions as functions of time: profiles, built-in motions, excitation, trajectories. No allocation, no I/O, no clock.
//!
//! Limits of a deployment are not applied here; [`crate::control`] applies them.

pub mod built_in;
pub mod excitation;
pub mod minimum_jerk;
pub mod rotation_order;
pub mod timeline;
pub mod trajectory;
