//! Refusal of a step of the reference.

use crate::control::signals::limits::Limit;

/// Reason why no stop from the end of a step was proved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The step or the stop does not keep this limit.
    Limit(Limit),
    /// The effort of the step was spent before the proof was complete. The next step continues with the balls
    /// that were found.
    Effort,
}

impl From<Limit> for Refusal {
    fn from(limit: Limit) -> Self {
        Self::Limit(limit)
    }
}
