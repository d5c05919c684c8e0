//! Context of one cycle.

use crate::control::constants::Constants;
use crate::control::signals::state::State;

/// Context of one cycle, available to every stage.
#[derive(Clone, Copy)]
pub(in crate::control) struct Cycle<'a> {
    pub constants: &'a Constants,
    pub release_ns: u64,
    /// State at the beginning of the cycle.
    pub state: State,
}
