//! Properties of a machine, a motion or a control loop, computed before the platform moves.
//!
//! [`envelope`] and [`reachable_envelope`] define the motions of a task, [`fidelity_error`] and [`fidelity_choice`] the
//! terms of the model that they need; [`pose_quality`], [`region_shape`], [`clearance`] and [`region_search`] compute the workspace,
//! [`assembly_modes`] the other poses with the same leg lengths, [`sampled_loop`] the margins of a sampled loop;
//! [`batch`] evaluates many motions on all processors. May allocate; not for the cycle.

pub mod assembly_modes;
pub mod batch;
pub mod clearance;
pub mod envelope;
pub mod fidelity_choice;
pub mod fidelity_error;
mod known_delay;
pub mod pose_quality;
pub mod reachable_envelope;
pub mod region_search;
pub mod region_shape;
pub mod sampled_loop;
