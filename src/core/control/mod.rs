//! Control of the platform: from setpoints and measurements to six forces. No allocation, no I/O, no clock,
//! no panic.
//!
//! [`controller::Controller::step`] is a pure function of its state and its input: every run can be replayed
//! bit for bit. Its stages in the order of a cycle:
//!
//! | stage | folder |
//! | --- | --- |
//! | validate the measurement, locate the platform | [`sensing`] |
//! | validate the setpoint | [`setpoint`] |
//! | tracking error with its estimator | [`law`] |
//! | checks of sensors, drives, load | [`monitoring`] |
//! | decide the state | [`supervision`] |
//! | reference | [`mod@reference`] |
//! | control law, forces | [`law`] |
//!
//! [`signals`] contains the types that the stages exchange, [`parameters`] the choices of a deployment,
//! [`constants`] the values derived from them. The checks of all stages return a [`signals::diagnostic`].

pub mod constants;
pub mod controller;
mod cycle;
pub mod law;
pub mod monitoring;
pub mod parameters;
pub mod reference;
pub mod sensing;
pub mod setpoint;
pub mod signals;
pub mod supervision;
#[cfg(test)]
mod tests;
