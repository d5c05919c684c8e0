//! Forward kinematics: the pose from six leg lengths, by Newton's method on SE(3).
//!
//! ```text
//! residual r_i = L_i - L_i(pose)      J^-1 [dw; dv] = r      R <- exp(dw~) R,   C <- C + dv
//! ```
//!
//! Quadratic convergence: from 2 mm and 0.2 deg to rounding in three iterations. Steps are added to the
//! rotation, not to Bryan angles (which converges only linearly).
//!
//! Lengths do not determine the pose: up to 40 real poses share them (assembly modes), and a small
//! residual says nothing about being on the wrong one. Uniqueness comes from continuity: [`solve`] needs
//! a start nearby, [`Tracker`] walks toward far lengths in steps small enough for that.
//!
//! Conditioning: errors of the lengths are amplified by the condition of N. At a singular pose there is
//! no solution to find and the result says not converged.

use fearless_simd::{Simd, dispatch, f64x8};
use nalgebra::Vector6;

use super::balance::Balance;
use super::inverse_geometry::{LegGeometry, leg_lengths};
use super::lanes::Eight;
use super::machine::{LEGS, Machine};
use super::rigid::Pose;
use super::triples::Lane;

/// Bound on Newton's iterations. Three suffice from one cycle to the next; beyond eight the start was not
/// in the region of quadratic convergence and more of the same does not help.
const MAX_ITERATIONS: u32 = 8;

/// A step this small, as a share of the platform's radius, leaves an error of its square: rounding.
const LAST_STEP: f64 = 1e-9;

/// A step larger than this share of the radius (or radian) is not Newton near a solution.
const TRUSTED_STEP: f64 = 0.5;

/// How far the lengths may move in one call of [`Tracker::advance`], as a share of the radius: 25 mm for
/// a platform of 0.5 m, an order of magnitude above what an actuator moves in 1 ms.
const TRACKED_STEP: f64 = 0.05;

/// Bound on the steps of [`Tracker::find`]: every leg may move ten times the radius.
const MAX_TRACKED_STEPS: u32 = 200;

/// Result of Newton's method.
#[derive(Clone, Copy, Debug)]
pub struct Solution {
    pub pose: Pose,
    pub iterations: u32,
    /// The last step was below the tolerance. Without it the pose must not be used.
    pub converged: bool,
}

/// The pose with these leg lengths \[m\] nearest to `start`, by at most eight iterations.
pub fn solve(machine: &Machine, start: &Pose, lengths: &[f64; LEGS]) -> Solution {
    let target = machine.joints.triples.pack(lengths);
    dispatch!(machine.level, simd => newton::<_, f64x8<_>>(simd, machine, start, &target))
}

#[inline(always)]
fn newton<S: Simd, V: Eight<S, Scalar = f64>>(
    simd: S,
    machine: &Machine,
    start: &Pose,
    target: &Lane,
) -> Solution {
    let target = V::load(simd, target);
    let mut pose = *start;
    for iterations in 1..=MAX_ITERATIONS {
        let legs = LegGeometry::<V>::new(simd, &machine.joints, &pose);
        let step = Balance::new(simd, &machine.joints, &legs).twist(target - legs.length);
        let Some(step) = step else { return Solution { pose, iterations, converged: false } };
        let size = step.angular.norm() + step.linear.norm() / machine.joints.radius;
        // Also false when it is not a number.
        if !(size < TRUSTED_STEP) {
            return Solution { pose, iterations, converged: false };
        }
        pose = pose.displaced(&step);
        if size < LAST_STEP {
            return Solution { pose, iterations, converged: true };
        }
    }
    Solution { pose, iterations: MAX_ITERATIONS, converged: false }
}

/// Follows measured lengths without leaving the assembly mode it started on.
#[derive(Clone, Copy, Debug)]
pub struct Tracker {
    /// Pose of the last converged step.
    pub pose: Pose,
    /// Lengths of the legs at `pose` \[m\].
    lengths: Vector6<f64>,
}

/// What one step of a [`Tracker`] achieved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tracked {
    /// The pose belongs to the given lengths.
    Found,
    /// The lengths are further away than one step: the pose is on its way.
    Approaching,
    /// Newton's method did not converge; the pose is the last good one.
    NotConverged,
}

impl Tracker {
    /// Starts at a known pose.
    pub fn new(machine: &Machine, pose: Pose) -> Self {
        Self { pose, lengths: leg_lengths(machine, &pose).into() }
    }

    /// One bounded step toward the pose with these lengths; also the iterations it took.
    pub fn advance(&mut self, machine: &Machine, lengths: &[f64; LEGS]) -> (Tracked, u32) {
        let change = Vector6::from(*lengths) - self.lengths;
        let share = TRACKED_STEP * machine.joints.radius / change.amax();
        let near = !(share < 1.0);
        let target = if near { Vector6::from(*lengths) } else { self.lengths + change * share };
        let solution = solve(machine, &self.pose, &target.into());
        if !solution.converged {
            return (Tracked::NotConverged, solution.iterations);
        }
        *self = Self { pose: solution.pose, lengths: target };
        (if near { Tracked::Found } else { Tracked::Approaching }, solution.iterations)
    }

    /// Steps until the pose is found: for use off line, where nobody waits.
    pub fn find(&mut self, machine: &Machine, lengths: &[f64; LEGS]) -> Solution {
        let mut iterations = 0;
        for _ in 0..MAX_TRACKED_STEPS {
            let (tracked, spent) = self.advance(machine, lengths);
            iterations += spent;
            if tracked != Tracked::Approaching {
                return Solution { pose: self.pose, iterations, converged: tracked == Tracked::Found };
            }
        }
        Solution { pose: self.pose, iterations, converged: false }
    }
}
