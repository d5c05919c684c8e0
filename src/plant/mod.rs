//! Simulated platform: what stands in for hardware. No allocation, no I/O, no clock.
//!
//! It obeys the full model with a machine of its own, which may differ from the controller's.
//! [`forward_dynamics`] turns forces into acceleration, [`integrator`] acceleration into motion,
//! [`simulator`] adds brakes and end stops.

pub mod forward_dynamics;
pub mod integrator;
pub mod simulator;
