//! Forward kinematics: pose from six leg lengths, by Newton's method on SE(3).
//!
//! ```text
//! residual r_i = L_i - L_i(pose)      J^-1 [dw; dv] = r      R <- turn(dw) R,   M <- M + dv
//! ```
//!
//! M is the mean of the joints on the platform, so that the path to the solution does not depend on the
//! choice of C. `turn` is Cayley's rotation, which differs from `exp` by a third-order term. Steps update the
//! rotation itself. Updating Bryan angles would converge only linearly.
//!
//! A factorization costs more than an evaluation of the lengths. It is therefore used again (chord method) if
//! a second step with it comes as near as a new factorization would. With the error e and the first step q,
//! the next error is `e^2` with a new factorization and `e q` with the old one. Before the last step r is
//! `(L_i^2 - |s_i|^2) / 2 L_i`, which has the same zero and needs neither root nor division. The last
//! factorization is at the solution and remains in the [`KinematicState`].
//!
//! Lengths do not determine the pose: up to 40 real poses share them (assembly modes), and a small residual
//! does not exclude a wrong one. Uniqueness follows from continuity. A step is only taken within
//! Kantorovich's bound ([`Sensitivity::trusted_step`](super::sensitivity::Sensitivity)), where exactly one
//! solution is nearby. [`refine`] requires a start within this bound; the platform moves less than that in a
//! cycle. [`Tracker`] moves toward distant lengths in such steps and cannot cross a singular pose. Its pose
//! is the only one on the straight path of the lengths. A platform that took another path is in another
//! assembly mode for one of 16,000 random poses up to 60 degrees from home (`tests/stability`). If the path
//! is unknown, `analysis::assembly_modes` searches for the other poses.
//!
//! Conditioning: the condition of N amplifies errors of the lengths. Trusted steps become shorter toward a
//! singular pose and end before it.

mod in_lanes;
mod newton;
mod tracker;

use fearless_simd::dispatch;

use serde::{Deserialize, Serialize};

pub use in_lanes::poses_near;
pub use tracker::{Tracker, TrackingResult};

use super::LEGS;
use super::factorization::Factorization;
use super::kinematic_state::KinematicState;
use super::machine::Machine;
use newton::Newton;

/// Largest number of steps in one call of [`refine`]. By Kantorovich's theorem, six steps reach rounding from
/// the edge of the trusted region.
pub const MAX_NEWTON_STEPS: u32 = 8;

/// Condition above which a pose counts as singular: an encoder error of 1 um is up to 1 cm at the platform,
/// and a leg force may be 10,000 times the load. Practical machines have 2 to 100.
pub const MAX_CONDITION: f64 = 1e4;

/// Outcome of forward kinematics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Outcome {
    /// The pose has these lengths, and no other pose in the trusted region has them.
    Solved,
    /// The iterations were used up, or a step was longer than the previous one.
    NotConverged,
    /// The lengths are further away than one trusted step.
    LeftTrustedRegion,
    /// The pose would be singular, beyond a singularity, or worse than [`MAX_CONDITION`].
    NearSingular,
}

/// Result of one call of [`refine`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonReport {
    /// Whether the pose was found, and if not, why.
    pub outcome: Outcome,
    /// Number of Newton steps.
    pub iterations: u32,
    /// Size of the first step, relative to the largest trusted step.
    pub step_ratio: f64,
}

/// Moves a kinematic state to the pose with these leg lengths \[m\], if that pose is within one trusted step.
/// Otherwise the state is unchanged.
///
/// ```
/// use hexad_core::model::{forward_kinematics::{Outcome, refine}, inverse_geometry::leg_lengths, kinematic_state::KinematicState};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
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
    lengths_m: &[f64; LEGS],
) -> NewtonReport {
    let joints = &machine.joints;
    let target = joints.triples.pack(lengths_m);
    dispatch!(machine.level, simd => {
        let legs = kinematic_state.legs.load(simd);
        let factorization = Factorization::load(simd, joints, &kinematic_state.factorization);
        Newton::new(simd, joints, target.load(simd)).refine(kinematic_state, legs, factorization)
    })
}
