//! Simulated platform: what stands in for hardware. No allocation, no I/O, no clock.
//!
//! It obeys the full model with a machine of its own, which may differ from the controller's.
//! [`forward_dynamics`] turns forces into acceleration, [`integrator`] acceleration into motion,
//! [`simulator`] adds brakes and end stops, [`hardware`] commands and sensors. [`imperfections`] lists what
//! can be worse than the model, [`terms`] chooses which of it is evaluated, and in what steps.

pub mod delay;
pub mod forward_dynamics;
pub mod hardware;
pub mod imperfections;
pub mod integrator;
pub mod random;
pub mod simulator;
pub mod terms;
