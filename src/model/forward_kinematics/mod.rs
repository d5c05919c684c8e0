//! Forward kinematics: the pose from six leg lengths, by Newton's method on SE(3).
//!
//! ```text
//! residual r_i = L_i - L_i(pose)      J^-1 [dw; dv] = r      R <- turn(dw) R,   M <- M + dv
//! ```
//!
//! M is the mean of the joints on the platform, so that the way to the solution does not depend on where C
//! is; `turn` is Cayley's rotation, which differs from `exp` by a third power. Steps are added to the rotation,
//! not to Bryan angles (which converges only linearly).
//!
//! A factorization costs more than an evaluation of the lengths, so it is used again (the chord method) where a
//! second step of it comes as near as a new one would. With the error e and the first step q the next error is
//! `e^2` with a new factorization, `e q` with the old one. On the way r is `(L_i^2 - |s_i|^2) / 2 L_i`, which
//! has the same zero and needs no root and no division. The last factorization is at the solution and stays
//! for all who need it ([`KinematicState`]).
//!
//! Lengths do not determine the pose: up to 40 real poses share them (assembly modes), and a small
//! residual says nothing about being on the wrong one. Uniqueness comes from continuity: a step is only
//! taken within Kantorovich's bound ([`Sensitivity::trusted_step`](super::sensitivity::Sensitivity)), where there is a solution nearby and only
//! one. [`refine`] needs a start that near, and the loop moves less than that in a cycle. [`Tracker`] walks toward
//! far lengths in such steps and cannot cross a singular pose. Where it then arrives is the only pose on the
//! straight way of the lengths; that a platform which came another way is elsewhere happens in one of 16,000
//! random poses up to 60 degrees from home (`tests/stability`), and who does not know the way has to search for
//! other poses: `host::assembly`.
//!
//! Conditioning: errors of the lengths are amplified by the condition of N. Toward a singular pose the
//! trusted steps become shorter and end before it.

mod newton;
mod tracker;

use fearless_simd::dispatch;

pub use tracker::{Tracked, Tracker};

use super::factorization::Factorization;
use super::kinematic_state::KinematicState;
use super::machine::{LEGS, Machine};
use newton::Newton;

/// Bound on the steps. From the edge of the trusted region six suffice to rounding, by Kantorovich.
pub const MAX_ITERATIONS: u32 = 8;

/// Beyond this condition a pose counts as singular: an encoder's error of 1 um is up to 1 cm at the platform, and
/// a leg may push 10,000 times the load. Machines that are meant to work have 2 to 100.
pub const LARGEST_CONDITION: f64 = 1e4;

/// How it went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The pose belongs to the lengths, and no other pose in the trusted region does.
    Solved,
    /// The iterations were used up, or became longer.
    NotConverged,
    /// The lengths are further away than one trusted step.
    LeftTrustedRegion,
    /// The pose would be singular, beyond a singular one, or worse than [`LARGEST_CONDITION`].
    NearSingular,
}

/// What a call of [`refine`] did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    pub outcome: Outcome,
    /// Steps of Newton's method.
    pub iterations: u32,
    /// Size of the first step over that of the largest trusted one.
    pub reach: f64,
}

/// Moves a kinematic_state to the pose with these leg lengths \[m\], if that is one trusted step away. Otherwise the
/// kinematic_state stays where it is.
pub fn refine(machine: &Machine, kinematic_state: &mut KinematicState, lengths: &[f64; LEGS]) -> Report {
    let joints = &machine.joints;
    let target = joints.triples.pack(lengths);
    dispatch!(machine.level, simd => {
        let legs = kinematic_state.legs.load(simd);
        let factorization = Factorization::load(simd, joints, &kinematic_state.factorization);
        Newton::new(simd, joints, target.load(simd)).refine(kinematic_state, legs, factorization)
    })
}
