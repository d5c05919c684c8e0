//! Tests that measure, or that take what all share: one after the other. The harness begins with the first names, so these are
//! done when the others begin.

mod churn;
mod demo;
mod doctor;
mod drive_delay;
mod estop_trials;
mod external;
mod guide;
mod hybrid;
mod simulated_time;
mod system_calls;
mod unprivileged;
