//! Motions as functions of time: profiles, built-in motions, excitation, trajectories; and the frames in which they are given.
//! No allocation, no I/O, no clock.
//!
//! Limits of a deployment are not applied here; [`crate::control`] applies them.

pub mod built_in;
pub mod excitation;
pub mod frames;
pub mod minimum_jerk;
pub mod rotation_order;
pub mod timeline;
pub mod tool_path;
pub mod trajectory;
