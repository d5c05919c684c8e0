//! From what is wanted and what is measured to six forces. No allocation, no I/O, no clock, no panic.
//!
//! [`controller::Controller::step`] is a pure function of its state and its input: every run can be
//! replayed bit for bit. In the order of a cycle: [`doubt`] decides which inputs count, [`supervisor`] which
//! [`state`] follows and why, [`mod@reference`] what the platform does in it, [`law`] with which acceleration,
//! and [`limits`] names what must not be exceeded. [`sampled`] says which [`gains`] the loop can carry.

pub mod controller;
pub mod doubt;
pub mod gains;
pub mod law;
pub mod leg_masses;
pub mod limits;
pub mod reference;
pub mod sampled;
pub mod state;
pub mod supervisor;
