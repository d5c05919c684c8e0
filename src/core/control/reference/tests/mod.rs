//! Tests of the reference generator: dense searches for a counterexample, next to motions that are just
//! accepted.

use fearless_simd::{Level, dispatch};

use crate::control::parameters::Envelope;
use crate::control::reference::Refusal;
use crate::control::reference::proof::drive_forces::{DriveForceBounds, ForceProof, StopDemand};
use crate::control::reference::proof::pose_bounds::PoseBounds;
use crate::control::reference::proof::regular_balls::RegularBalls;
use crate::control::reference::proof::regularity::{Regularity, RegularityQuery};
use crate::control::reference::proof::step::{Step, inner_speeds};
use crate::control::reference::proof::verification::Verifier;
use crate::control::reference::stop::pose_stop::{PoseStop, StopKind, advanced};
use crate::control::tests::*;
use crate::model::conditioning::Conditioning;
use crate::model::inverse_geometry::{leg_lengths_and_rates, leg_motion, universal_sine};

mod approach;
mod between_knots;
mod cubic_departure;
mod drive_forces;
mod generator;
mod generator_bounds;
mod knots;
mod motion;
mod regularity;
mod verification;

/// Whether balls prove all poses within a reach of a pose, with the reference's bounds. New balls are added
/// as needed.
fn is_covered(balls: &mut RegularBalls, constants: &Constants, pose: &Pose, reach: Pair<f64>) -> bool {
    let around = RegularityQuery { pose, reach, required: Regularity::reference_bounds(constants) };
    balls.prove(constants, &around, &mut unlimited_forces(constants), &mut u32::MAX.clone())
}

/// Proof of forces that no stop exceeds.
fn unlimited_forces(constants: &Constants) -> ForceProof {
    let bounds = DriveForceBounds { holding_n: f64::INFINITY, moving_n: f64::INFINITY };
    ForceProof::new(constants, StopDemand::default(), bounds, StopKind::ReleaseFirst)
}
