//! Stops of the reference, in closed form.

pub(super) mod acceleration_ranges;
pub(super) mod constant_jerk;
pub(super) mod held_stop;
pub(super) mod pose_stop;
pub(super) mod vector_stop;
