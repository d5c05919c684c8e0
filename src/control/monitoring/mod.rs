//! Checks of the estimate under control: what sensors, drives and the load do that the model does not know.
//!
//! | what | file |
//! | --- | --- |
//! | sensors that repeat a length | `frozen_sensors` |
//! | drives without force | `drive_response`, with `weighting` |
//! | payload, impact, oscillation | [`disturbance_monitor`] |

pub mod disturbance_monitor;
pub(super) mod drive_response;
pub(super) mod frozen_sensors;
pub(super) mod weighting;
