//! The mathematics of the machine and its simulated platform, against independent references.

mod batch;
mod calibration;
mod excitation;
mod fidelity;
mod identification;
mod ladder;
mod near_singular;
mod paper;
mod plant;
mod properties;
mod stability;
mod workspace;

use core::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use hexad::analysis::envelope::{CORNER_COUNT, DIMENSIONS, EnvelopeBounds, EnvelopePoint, MotionEnvelope};
use hexad::config::Config;
use hexad::control::signals::limits::{DerivativeLimits, Limit, Limits};
use hexad::model::LEGS;
use hexad::model::active_forces::{InverseDynamics, inverse_dynamics};
use hexad::model::fidelity::{Exact, Fidelity, LumpedLegs, MasslessLegs, NoVelocity, RigidLegs};
use hexad::model::forward_kinematics::{MAX_CONDITION, Outcome, Tracker, TrackingResult, refine};
use hexad::model::inverse_geometry::{leg_directions, leg_lengths, leg_motion};
use hexad::model::inverse_jacobian::{condition, leg_wrenches, scaled_wrenches, twist_from_rates};
use hexad::model::kinematic_state::KinematicState;
use hexad::model::machine::{Link, Machine};
use hexad::model::random::Random;
use hexad::model::rigid::{Acceleration, Motion, Pose, Twist, Wrench, exp, log};
use hexad::model::task::{TaskState, task_coordinates};
use hexad::motion::frames::Frames;
use hexad::plant::forward_dynamics::ForwardDynamics;
use hexad::plant::imperfections::{
    BuildErrors, DriveErrors, ElasticLeg, ExternalWrench, Friction, Imperfections, SensorErrors,
};
use hexad_support::{
    Errors, Legs, MACHINES, Table, angle_between, data, deployed, largest, machine, motions, rotation,
};
use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3, Vector6};
use tempfile::TempDir;

/// Asserts a bound on an error over the motions of machines.
fn assert_each_within(
    bound: f64,
    what: &str,
    machines: &[&str],
    mut error: impl FnMut(&Machine, &Motion) -> f64,
) {
    for name in machines {
        let (machine, mut errors) = (machine(name), Errors::default());
        motions(name).iter().for_each(|motion| errors.add(error(&machine, motion)));
        errors.assert_within(bound, &format!("{name} {what}"));
    }
}

/// Evenly in -1..1.
fn vector(random: &mut Random) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.signed())
}
