//! Context of one cycle.

use crate::control::constants::Constants;
use crate::control::signals::state::State;

/// Context of one cycle, which every stage may depend on.
#[derive(Clone, Copy)]
pub(in crate::control) struct Cycle<'a> {
    pub constants: &'a Constants,
    pub release_ns: u64,
    /// At the beginning of the cycle.
    pub state: State,
}
