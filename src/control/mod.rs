//! Control of the platform: from setpoints and measurements to six forces. No allocation, no I/O, no clock, no panic.
//!
//! [`controller::Controller::step`] is a pure function of its state and its input: every run can be
//! replayed bit for bit. Its stages in the order of a cycle:
//!
//! | stage | file |
//! | --- | --- |
//! | validate inputs | [`input_validation`] |
//! | locate platform, tracking error | [`localization`], [`tracking_error`] with its [`estimator`] |
//! | decide state | `assessment`, [`supervisor`] with the states of [`state`] |
//! | reference | [`mod@reference`] |
//! | control law | [`law`] with its [`gains`] and [`leg_masses`] |
//! | forces | `forces` |
//! | checks | `drive_response`, `disturbance_monitor`, `feedback_bound`, `force_limits` |
//!
//! The checks of all stages return a [`diagnostic`]; the bounds are in [`parameters`] and [`limits`].

mod assessment;
pub mod controller;
pub mod diagnostic;
pub mod disturbance_monitor;
pub mod drive_monitor;
mod drive_response;
pub mod estimator;
mod external_pose;
mod feedback_bound;
mod force_limits;
mod forces;
mod free_motion;
pub mod gains;
pub mod input_validation;
mod inputs;
pub mod law;
pub mod leg_masses;
pub mod limits;
pub mod localization;
pub mod parameters;
pub mod reference;
mod stamp_clock;
mod standstill;
pub mod state;
pub mod supervisor;
pub mod tracking_error;
