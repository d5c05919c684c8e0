//! From a setpoint to the target of the reference.
//!
//! | what | file |
//! | --- | --- |
//! | motion of a setpoint, and its continuation | [`motion`] |
//! | samples of poses without derivatives | [`pose_samples`] |
//! | what the reference approaches | [`target`] |
//! | validate the setpoint | [`validation`], `validated` |

pub mod motion;
pub mod pose_samples;
pub mod target;
pub(super) mod validated;
pub mod validation;
