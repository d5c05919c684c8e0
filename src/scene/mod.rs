//! Scenes: what the platform is asked to do, and how much of the model that needs. No allocation, no I/O,
//! no clock.

pub mod clearance;
pub mod envelope;
pub mod fidelity;
pub mod minimum_jerk;
pub mod motions;
pub mod reach;
pub mod tally;
pub mod timeline;
pub mod trajectory;
pub mod workspace;
