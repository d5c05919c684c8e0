//! Properties of a machine, a motion or a control loop, computed before the platform moves.
//!
//! | subject | module |
//! | --- | --- |
//! | motions of a task | [`envelope`], [`reachable_envelope`] |
//! | terms of the model that they need | [`fidelity_error`], [`fidelity_choice`] |
//! | workspace | [`drive_capability`], [`gravity_cone`], [`pose_quality`], [`region_shape`], [`clearance`], [`region_search`], [`region_proof`] |
//! | collisions between legs | [`leg_crossing`] |
//! | other poses with the same leg lengths | [`assembly_modes`], [`other_pose_search`] |
//! | parameters of a machine from recorded motions | [`identification`], [`drive_delay`] |
//! | joints and zeros of the lengths from poses that a tracker has measured | [`calibration`] |
//! | how fast the platform leaves a pose under constant forces | [`held_forces`] |
//! | motion that shows the parameters | [`excitation_design`] |
//! | margins of a sampled loop | [`sampled_loop`] |
//! | path of the reference to a target | [`target_motion`] |
//! | straight path of a tool, within the limits | [`tool_motion`] |
//! | derivatives of a motion given by poses | [`pose_spline`] |
//! | many motions, on all processors | [`batch`] |
//!
//! These functions may allocate, so the cycle does not call them.

pub mod assembly_modes;
pub mod assembly_proof;
pub mod batch;
pub mod calibration;
pub mod clearance;
pub mod drive_capability;
pub mod drive_delay;
pub mod envelope;
pub mod excitation_design;
pub mod fidelity_choice;
pub mod fidelity_error;
pub mod force_integrals;
pub mod gravity_cone;
pub mod held_forces;
pub mod identification;
mod known_delay;
pub mod leg_crossing;
pub mod other_pose_search;
pub mod pose_quality;
pub mod pose_spline;
pub mod reachable_envelope;
pub mod region_proof;
pub mod region_search;
pub mod region_shape;
pub mod sampled_loop;
pub mod target_motion;
pub mod tool_motion;
