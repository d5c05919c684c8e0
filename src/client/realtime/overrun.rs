//! Policy for grid points that pass before a thread is ready.
//!
//! Every point is either run or counted as skipped: cycles + skipped = points passed, exactly.

/// Policy after a cycle that was not finished at the next release, or after a thread was suspended for whole periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OverrunPolicy {
    /// Waits for the next point: fixed period, never a burst.
    Skip,
    /// Runs the latest points passed at once and skips those before them.
    CatchUp {
        /// Points run at once, at most.
        most: u64,
    },
    /// As `Skip`, and the next cycle reports a fault.
    Fault,
}

impl OverrunPolicy {
    /// Number of the points `behind` that are skipped, the earliest first; the others are run at once.
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
