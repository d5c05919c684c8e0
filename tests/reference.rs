//! The reference generator alone, against limits evaluated independently of it: targets of every kind, hostile ones too.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod arrival;
mod goto;
mod limits;
mod observer;
mod rates;
mod streams;
mod walls;
mod weak_poses;
