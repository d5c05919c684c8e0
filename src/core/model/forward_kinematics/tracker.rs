//! Tracker: forward kinematics for distant lengths, along a straight path of the lengths in trusted steps.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use super::{NewtonReport, Outcome, refine};
use crate::model::LEGS;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::Machine;
use crate::model::rigid::Pose;

/// Share of a trusted step that is taken toward distant lengths; below 1, so that rounding does not exceed
/// the step.
const TRUSTED_STEP_SHARE: f64 = 0.99;

/// Largest number of steps of [`Tracker::find`]. One step is a few hundredths of the radius. Toward a
/// singular pose the steps end after about fifty.
const MAX_TRACKING_STEPS: u32 = 2000;

/// Tracker of measured leg lengths; it stays in the assembly mode of its start.
///
/// ```
/// use hexad_core::model::forward_kinematics::{Tracker, TrackingResult};
/// use hexad_core::model::inverse_geometry::leg_lengths;
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let mut pose = machine.home_pose();
/// pose.position.x += 0.1;
/// let mut tracker = Tracker::new(&machine, machine.home_pose());
/// let (result, _) = tracker.find(&machine, &leg_lengths(&machine, &pose));
/// assert_eq!(result, TrackingResult::Found);
/// assert!((tracker.pose().position - pose.position).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Tracker {
    /// State after the last converged step.
    kinematic_state: KinematicState,
    outcome: Outcome,
}

/// Result of one step of a [`Tracker`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackingResult {
    /// The pose has the given lengths.
    Found,
    /// The lengths are further away than one step: the pose is between the previous pose and theirs.
    Approaching,
    /// No trusted step leads toward the lengths; the pose is the last valid one. [`Tracker::outcome`] gives
    /// the reason.
    NotConverged,
}

impl Tracker {
    /// Creates a tracker at a pose.
    pub fn new(machine: &Machine, pose: Pose) -> Self {
        Self { kinematic_state: KinematicState::new(machine, pose), outcome: Outcome::Solved }
    }

    /// Restarts at a kinematic state.
    pub fn restart(&mut self, kinematic_state: &KinematicState) {
        (self.kinematic_state, self.outcome) = (*kinematic_state, Outcome::Solved);
    }

    /// Pose after the last converged step.
    pub fn pose(&self) -> &Pose {
        self.kinematic_state.pose()
    }

    /// Pose after the last converged step, with its legs and factorization.
    pub fn kinematic_state(&self) -> &KinematicState {
        &self.kinematic_state
    }

    /// Outcome of the last step.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Takes one trusted step toward the pose with these lengths. Also returns the number of iterations.
    pub fn advance(&mut self, machine: &Machine, lengths_m: &[f64; LEGS]) -> (TrackingResult, u32) {
        let mut iterations = 0;
        let mut tracked = TrackingResult::Found;
        let mut report = self.step(machine, lengths_m, &mut iterations);
        if report.outcome == Outcome::LeftTrustedRegion {
            tracked = TrackingResult::Approaching;
            let here = Vector6::from(self.kinematic_state.lengths(machine));
            let part = here + (Vector6::from(*lengths_m) - here) * (TRUSTED_STEP_SHARE / report.step_ratio);
            report = self.step(machine, &part.into(), &mut iterations);
        }
        (if report.outcome == Outcome::Solved { tracked } else { TrackingResult::NotConverged }, iterations)
    }

    fn step(&mut self, machine: &Machine, lengths: &[f64; LEGS], iterations: &mut u32) -> NewtonReport {
        let report = refine(machine, &mut self.kinematic_state, lengths);
        *iterations += report.iterations;
        self.outcome = report.outcome;
        report
    }

    /// Takes steps until the pose is found. Also returns the number of iterations. Not for the cycle: the
    /// steps may take longer than a cycle.
    pub fn find(&mut self, machine: &Machine, lengths_m: &[f64; LEGS]) -> (TrackingResult, u32) {
        let mut iterations = 0;
        for _ in 0..MAX_TRACKING_STEPS {
            let (tracked, spent) = self.advance(machine, lengths_m);
            iterations += spent;
            if tracked != TrackingResult::Approaching {
                return (tracked, iterations);
            }
        }
        self.outcome = Outcome::NotConverged;
        (TrackingResult::NotConverged, iterations)
    }
}
