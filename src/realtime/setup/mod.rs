//! What makes a process fit for real time: memory that is there, a scheduling class, a processor of its
//! own, processors that do not sleep deeply.
//!
//! Each step that is refused says why and what cures it ([`Shortfall`]); the caller decides whether to go
//! on. [`permissions`] knows the same in advance, without a step being taken.

pub mod budget;
pub mod cpus;
pub mod deadline;
pub mod denormals;
pub mod idle;
pub mod memory;
pub mod permissions;
pub mod refusals;
pub mod scheduling;

/// A step that was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {what}: {reason}; {remedy}")]
pub struct Shortfall {
    pub what: String,
    pub reason: String,
    pub remedy: String,
}
