//! Computation of pose and twist of the platform from a measurement. The files in the order of the data:
//!
//! | step | file |
//! | --- | --- |
//! | check the clock of the stamps | `stamp_clock` |
//! | validate the measurement | `measurement`, with `last_input` |
//! | check drives and external pose | `drive_monitor`, `external_pose` |
//! | leg rates | `leg_rates` |
//! | pose and twist | [`localization`] |
//! | motion without force | `free_motion`, `standstill` |

pub(super) mod drive_monitor;
pub(super) mod external_pose;
pub(super) mod free_motion;
pub(super) mod last_input;
pub(super) mod leg_rates;
pub mod localization;
pub(super) mod measurement;
pub(super) mod stamp_clock;
pub(super) mod standstill;
