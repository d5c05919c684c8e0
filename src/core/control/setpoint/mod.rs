//! Computation of the reference's target from a setpoint.
//!
//! | step | file |
//! | --- | --- |
//! | motion of a setpoint and its continuation | [`motion`] |
//! | motion through samples of poses without derivatives | [`pose_samples`] |
//! | target of the reference | [`target`] |
//! | validate the setpoint | [`validation`], `validated` |

pub mod motion;
pub mod pose_samples;
pub mod target;
pub(super) mod validated;
pub mod validation;
