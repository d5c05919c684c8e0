//! Properties of a machine, a motion or a control loop, computed before the platform moves.
//!
//! [`envelope`] and [`reachable_envelope`] say which motions are meant, [`fidelity_error`] and [`fidelity_choice`] which
//! terms of the model they need; [`pose_quality`], [`clearance`] and [`region_search`] what the workspace offers;
//! [`assembly_modes`] which other poses have the same leg lengths; [`sampled_loop`] how far a loop is from unstable.

pub mod assembly_modes;
pub mod batch;
pub mod clearance;
pub mod envelope;
pub mod fidelity_choice;
pub mod fidelity_error;
pub mod pose_quality;
pub mod reachable_envelope;
pub mod region_search;
pub mod sampled_loop;
