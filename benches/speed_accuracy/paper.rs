//! The paper's own form, dense global matrices and leg angles explicit: the oracle of `tests/paper`, timed.
//!
//! It starts from task coordinates, so its time includes the sines of the Bryan angles; every other method
//! is given the rotation matrix.

use nalgebra::Vector6;

pub use hexad_support::paper::kinematics::State;
pub use hexad_support::paper::machine::Machine;
use hexad_support::paper::{force, form};

/// Forces of the six legs with every term, the drives' share included \[N\].
pub fn forces(machine: &Machine, state: &State) -> Vector6<f64> {
    force::forces(machine, state, &form::EXACT)
}
