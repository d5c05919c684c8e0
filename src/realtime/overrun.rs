//! What becomes of the grid points that a thread was not ready for.
//!
//! Every point is either run or counted as skipped, so that cycles + skipped = points passed, exactly.

/// What follows a cycle that was not done at its next release, or a thread that was held for whole periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OverrunPolicy {
    /// The next point is waited for: fixed period, never a burst.
    Skip,
    /// At most so many of the points passed are run at once; those before them are skipped.
    CatchUp { most: u64 },
    /// As `Skip`, and the next cycle is told, which makes it a fault.
    Fault,
}

impl OverrunPolicy {
    /// How many of the points left `behind` are skipped, the earliest first; the others are run at once.
    pub fn skipped(self, behind: u64) -> u64 {
        behind.saturating_sub(self.most())
    }

    fn most(self) -> u64 {
        match self {
            Self::Skip | Self::Fault => 0,
            Self::CatchUp { most } => most,
        }
    }
}
