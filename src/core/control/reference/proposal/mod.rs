//! Proposal for the next step: the acceleration towards the target and away from bounds.

pub(super) mod approach;
pub(super) mod walls;
