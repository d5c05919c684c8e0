//! Real-time set-up of a process: resident memory, scheduling class, processor affinity, bounded wake-up latency.
//!
//! A step that the kernel refuses returns a [`Shortfall`] with reason and remedy; the caller decides whether to
//! continue. [`permissions`] finds the same in advance, without taking a step.

pub mod budget;
pub mod cpus;
pub mod deadline;
pub mod denormals;
pub mod idle;
pub mod memory;
pub mod open_files;
pub mod permissions;
pub mod refusals;
pub mod scheduling;

/// Set-up step that the kernel refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {what}: {reason}; {remedy}")]
pub struct Shortfall {
    /// The step.
    pub what: String,
    /// Why the kernel refused it.
    pub reason: String,
    /// What to do.
    pub remedy: String,
}
