//! Where methods fail: assembly modes, far starts, sizes, offsets, sampling. Each case has its predicted outcome.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod beyond;
mod check;
mod dietmaier;
mod fichter;
mod gimbal;
mod legs;
mod passing;
mod random;
mod sampled;
mod sizes;

use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad::control::signals::state::{Request, State};
use hexad::motion::minimum_jerk::{Profile, rise};
use hexad_support::rig::Rig;
use hexad_support::stability::trials::{End, Method, ambiguous, pose, rigid, step, trial, within_reach};

use crate::*;
