//! The paper's own form, dense global matrices and leg angles explicit: the oracle of `tests/paper`, timed.
//!
//! It starts from task coordinates, so its time includes the sines of the Bryan angles; every other method
//! is given the rotation matrix.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests, of which this bench uses a part"
)]

use nalgebra::Vector6;

#[path = "../../tests/common/mod.rs"]
pub mod common;
#[path = "../../tests/paper/dense.rs"]
mod dense;
#[path = "../../tests/paper/force.rs"]
mod force;
#[path = "../../tests/paper/form.rs"]
mod form;
#[path = "../../tests/paper/kinematics.rs"]
mod kinematics;
#[path = "../../tests/paper/machine.rs"]
mod machine;

pub use kinematics::State;
pub use machine::Machine;

/// Forces of the six legs with every term, the drives' share included \[N\].
pub fn forces(machine: &Machine, state: &State) -> Vector6<f64> {
    force::forces(machine, state, &form::EXACT)
}
