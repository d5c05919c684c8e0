//! From what is wanted and what is measured to six forces. No allocation, no I/O, no clock, no panic.
//!
//! [`controller::Controller::step`] is a pure function of its state and its input: every run can be
//! replayed bit for bit. [`law`] is the control law, [`gains`] says what a sampled loop can carry,
//! [`state`] numbers the states and the faults.

pub mod controller;
pub mod gains;
pub mod doubt;
pub mod law;
pub mod reference;
pub mod state;
pub mod supervisor;
