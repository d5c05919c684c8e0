//! Scenes: what the platform is asked to do. No allocation, no I/O, no clock.

pub mod minimum_jerk;
pub mod motions;
pub mod timeline;
pub mod trajectory;
