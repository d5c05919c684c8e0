//! The cyclic loop: every grid point is run or counted, every miss in its class and at its cycle.
//!
//! On a clock of the test's own every delay is exact, so the counts are too; the definitions are tried
//! against a second implementation that walks the grid point by point. On the real clock the loop must
//! agree with what the test itself saw, whatever the host did meanwhile.

#![allow(clippy::expect_used, clippy::unreachable, clippy::indexing_slicing, reason = "helpers of tests")]

mod external;
mod oracle;
mod policies;
mod real_clock;
mod rig;
mod rights;
