//! Why a step of the reference is refused.

use crate::control::signals::limits::Limit;

/// Why no stop from the end of a step was proved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The stop does not keep this limit.
    Limit(Limit),
    /// The effort of a cycle was spent before the proof was complete. The next cycle goes on with the balls that were found.
    Effort,
}

impl From<Limit> for Refusal {
    fn from(limit: Limit) -> Self {
        Self::Limit(limit)
    }
}
