//! Checks of the estimate under control: failures of sensors and drives, and changes of the load.
//!
//! | failure or change | file |
//! | --- | --- |
//! | sensor that repeats a length | `frozen_sensors` |
//! | drive without force | `drive_response`, with `weighting` |
//! | friction that the file does not state | [`unstated_friction`] |
//! | payload, impact, oscillation | [`disturbance_monitor`] |

pub mod disturbance_monitor;
pub(super) mod drive_response;
pub(super) mod frozen_sensors;
pub mod unstated_friction;
pub(super) mod weighting;
