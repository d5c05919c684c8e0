//! Checks of the estimate under control: failures of sensors and drives, and changes of the load.
//!
//! | failure or change | file |
//! | --- | --- |
//! | sensor that repeats a length | `frozen_sensors` |
//! | drive without force | `drive_response`, with `weighting` |
//! | payload, impact, oscillation | [`disturbance_monitor`] |

pub mod disturbance_monitor;
pub(super) mod drive_response;
pub(super) mod frozen_sensors;
pub(super) mod weighting;
