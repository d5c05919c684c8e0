//! Forward kinematics: the pose from six leg lengths, by Newton's method on SE(3).
//!
//! ```text
//! residual r_i = L_i - L_i(pose)      J^-1 [dw; dv] = r      R <- turn(dw) R,   M <- M + dv
//! ```
//!
//! M is the mean of the joints on the platform, so that the path to the solution does not depend on where C
//! is; `turn` is Cayley's rotation, which differs from `exp` by a third power. Steps are added to the rotation,
//! not to Bryan angles (which converges only linearly).
//!
//! A factorization costs more than an evaluation of the lengths, so it is used again (the chord method) where a
//! second step of it comes as near as a new one would. With the error e and the first step q the next error is
//! `e^2` with a new factorization, `e q` with the old one. Before the last step r is `(L_i^2 - |s_i|^2) / 2 L_i`, which
//! has the same zero and needs no root and no division. The last factorization is at the solution and remains
//! in the [`KinematicState`].
//!
//! Lengths do not determine the pose: up to 40 real poses share them (assembly modes), and a small
//! residual says nothing about being on the wrong one. Uniqueness comes from continuity: a step is only
//! taken within Kantorovich's bound ([`Sensitivity::trusted_step`](super::sensitivity::Sensitivity)), where there is a solution nearby and only
//! one. [`refine`] needs a start that near, and the loop moves less than that in a cycle. [`Tracker`] walks toward
//! far lengths in such steps and cannot cross a singular pose. The pose it finds is the only one on the
//! straight path of the lengths. A platform that took another path is in another assembly mode for one of 16,000
//! random poses up to 60 degrees from home (`tests/stability`); where the path is unknown, `analysis::assembly_modes`
//! searches for the other poses.
//!
//! Conditioning: errors of the lengths are amplified by the condition of N. Toward a singular pose the
//! trusted steps become shorter and end before it.

mod newton;
mod tracker;

use fearless_simd::dispatch;

pub use tracker::{Tracker, TrackingResult};

use super::LEGS;
use super::factorization::Factorization;
use super::kinematic_state::KinematicState;
use super::machine::Machine;
use newton::Newton;

/// Most steps of one call of [`refine`]. From the edge of the trusted region six suffice to rounding, by Kantorovich.
pub const MAX_NEWTON_STEPS: u32 = 8;

/// Condition beyond which a pose counts as singular: an encoder's error of 1 um is up to 1 cm at the platform, and
/// a leg may push 10,000 times the load. Machines that are meant to work have 2 to 100.
pub const MAX_CONDITION: f64 = 1e4;

/// Outcome of forward kinematics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub enum Outcome {
    /// The pose belongs to the lengths, and no other pose in the trusted region does.
    Solved,
    /// The iterations were used up, or became longer.
    NotConverged,
    /// The lengths are further away than one trusted step.
    LeftTrustedRegion,
    /// The pose would be singular, beyond a singular one, or worse than [`MAX_CONDITION`].
    NearSingular,
}

/// Result of one call of [`refine`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonReport {
    /// Whether the pose was found, and if not, why.
    pub outcome: Outcome,
    /// Steps of Newton's method.
    pub iterations: u32,
    /// Size of the first step over that of the largest trusted one.
    pub step_ratio: f64,
}

/// Moves a kinematic state to the pose with these leg lengths \[m\], if that is one trusted step away; otherwise the
/// state remains unchanged.
///
/// ```
/// use hexad::model::{forward_kinematics::{Outcome, refine}, inverse_geometry::leg_lengths, kinematic_state::KinematicState};
/// # let machine = hexad::config::Config::load("config/tsai2000.toml".as_ref()).unwrap().machine;
/// let mut state = KinematicState::new(&machine, machine.home_pose());
/// let mut pose = machine.home_pose();
/// pose.position.z += 1e-3;
/// let report = refine(&machine, &mut state, &leg_lengths(&machine, &pose));
/// assert_eq!(report.outcome, Outcome::Solved);
/// assert!((state.pose().position - pose.position).norm() < 1e-14);
/// ```
pub fn refine(
    machine: &Machine,
    kinematic_state: &mut KinematicState,
    lengths: &[f64; LEGS],
) -> NewtonReport {
    let joints = &machine.joints;
    let target = joints.triples.pack(lengths);
    dispatch!(machine.level, simd => {
        let legs = kinematic_state.legs.load(simd);
        let factorization = Factorization::load(simd, joints, &kinematic_state.factorization);
        Newton::new(simd, joints, target.load(simd)).refine(kinematic_state, legs, factorization)
    })
}
