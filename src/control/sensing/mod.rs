//! From a measurement to pose and twist of the platform, in the order of the data.
//!
//! | what | file |
//! | --- | --- |
//! | clock of the stamps | `stamp_clock` |
//! | validate the measurement | `measurement`, with `last_valid` |
//! | status of the drives, pose by another sensor | `drive_monitor`, `external_pose` |
//! | rates of the legs | `leg_rates` |
//! | pose and twist | [`localization`] |
//! | motion without force | `free_motion`, `standstill` |

pub(super) mod drive_monitor;
pub(super) mod external_pose;
pub(super) mod free_motion;
pub(super) mod last_valid;
pub(super) mod leg_rates;
pub mod localization;
pub(super) mod measurement;
pub(super) mod stamp_clock;
pub(super) mod standstill;
