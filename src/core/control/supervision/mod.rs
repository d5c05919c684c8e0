//! Decisions of a cycle: whether control may begin or must end, and the next state. Pure functions.

pub(super) mod assessment;
pub mod in_position;
pub mod supervisor;
