//! Controller and simulated platform in one loop, in simulated time: tracking, replay, faults.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod ages;
mod allowed_disturbances;
mod answer;
mod assessment;
mod built_in;
mod disturbances;
mod drive_delay;
mod drive_status;
mod estimator;
mod evidence;
mod external_pose;
mod false_alarms;
mod feedback;
mod fidelities;
mod hardware_failures;
mod identification;
mod identification_worlds;
mod inputs;
mod limits;
mod modes;
mod pivot;
mod policies;
mod poses;
mod replay;
mod ride;
mod setpoints;
mod sources;
mod stamp_clock;
mod stamps;
mod targets;
mod tracking;
mod transmission;
mod trust;
mod unstated;
mod weak_poses;
