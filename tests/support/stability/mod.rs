//! Trials of forward kinematics and of delayed loops, and the methods of others.

pub mod delayed;
pub mod rivals;
pub mod trials;
