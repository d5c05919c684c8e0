//! Simulated platform in place of hardware. No allocation, no I/O, no clock.
//!
//! It obeys the full model with a machine of its own, which may differ from the controller's.
//! [`forward_dynamics`] turns forces into acceleration, [`integrator`] acceleration into motion,
//! [`simulator`] adds brakes and end stops, [`hardware`] dead time, drives and sensors. [`imperfections`] lists the
//! deviations from the model, [`terms`] chooses those that are evaluated and the step of the integration.

pub mod delay;
pub mod forward_dynamics;
pub mod hardware;
pub mod imperfections;
pub mod integrator;
pub mod simulator;
pub mod terms;
