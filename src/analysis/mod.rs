//! Properties of a machine, a motion or a control loop, computed before the platform moves.
//!
//! [`envelope`] and [`reachable_envelope`] define the motions of a task, [`fidelity_error`] and [`fidelity_choice`] the
//! terms of the model that they need; [`drive_capability`], [`pose_quality`], [`region_shape`], [`clearance`], [`region_search`] and [`region_proof`]
//! the workspace, [`leg_crossing`] legs in each other's way,
//! [`assembly_modes`] the other poses with the same leg lengths, [`held_forces`] how fast the platform leaves a pose whose forces are held, [`sampled_loop`] the margins of a sampled loop;
//! [`target_motion`] the reference's way to a target, [`pose_spline`] the derivatives of a motion given by poses; [`batch`] evaluates many motions on all processors. May allocate; not for the cycle.

pub mod assembly_modes;
pub mod batch;
pub mod clearance;
pub mod drive_capability;
pub mod drive_delay;
pub mod envelope;
pub mod fidelity_choice;
pub mod fidelity_error;
pub mod held_forces;
mod known_delay;
pub mod leg_crossing;
pub mod pose_quality;
pub mod pose_spline;
pub mod reachable_envelope;
pub mod region_proof;
pub mod region_search;
pub mod region_shape;
pub mod sampled_loop;
pub mod target_motion;
