//! Following measured lengths.

use nalgebra::Vector6;

use super::{Outcome, Report, refine};
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::Pose;

/// How much of a trusted step is taken toward lengths that are further away: rounding must not undo it.
const PART_OF_TRUSTED: f64 = 0.99;

/// Bound on the steps of [`Tracker::find`]: one is some hundredths of the radius, and the steps toward a singular
/// pose end after about fifty.
const MOST_STEPS: u32 = 2000;

/// Follows measured lengths without leaving the assembly mode it started on.
#[derive(Clone, Copy, Debug)]
pub struct Tracker {
    /// Pose of the last converged step.
    pub pose: Pose,
    /// The same with its legs and factorization.
    kinematic_state: KinematicState,
    outcome: Outcome,
}

/// What one step of a [`Tracker`] achieved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tracked {
    /// The pose belongs to the given lengths.
    Found,
    /// The lengths are further away than one step: the pose is on its way.
    Approaching,
    /// There is no trusted step toward the lengths; the pose is the last good one. [`Tracker::outcome`] says why.
    NotConverged,
}

impl Tracker {
    /// Starts at a known pose.
    pub fn new(machine: &Machine, pose: Pose) -> Self {
        Self { pose, kinematic_state: KinematicState::new(machine, pose), outcome: Outcome::Solved }
    }

    /// Starts anew at a pose of which all is known.
    pub fn restart(&mut self, kinematic_state: &KinematicState) {
        (self.pose, self.kinematic_state, self.outcome) =
            (*kinematic_state.pose(), *kinematic_state, Outcome::Solved);
    }

    /// The pose with its legs and factorization.
    pub fn kinematic_state(&self) -> &KinematicState {
        &self.kinematic_state
    }

    /// Of the last step.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// One trusted step toward the pose with these lengths; also the iterations it took.
    pub fn advance(&mut self, machine: &Machine, lengths: &[f64; LEGS]) -> (Tracked, u32) {
        let mut iterations = 0;
        let mut tracked = Tracked::Found;
        let mut report = self.step(machine, lengths, &mut iterations);
        if report.outcome == Outcome::LeftTrustedRegion {
            tracked = Tracked::Approaching;
            let here = Vector6::from(self.kinematic_state.lengths(machine));
            let part = here + (Vector6::from(*lengths) - here) * (PART_OF_TRUSTED / report.reach);
            report = self.step(machine, &part.into(), &mut iterations);
        }
        (if report.outcome == Outcome::Solved { tracked } else { Tracked::NotConverged }, iterations)
    }

    fn step(&mut self, machine: &Machine, lengths: &[f64; LEGS], iterations: &mut u32) -> Report {
        let report = refine(machine, &mut self.kinematic_state, lengths);
        *iterations += report.iterations;
        (self.pose, self.outcome) = (*self.kinematic_state.pose(), report.outcome);
        report
    }

    /// Steps until the pose is found: for use off line, where nobody waits. Also the iterations it took.
    pub fn find(&mut self, machine: &Machine, lengths: &[f64; LEGS]) -> (Tracked, u32) {
        let mut iterations = 0;
        for _ in 0..MOST_STEPS {
            let (tracked, spent) = self.advance(machine, lengths);
            iterations += spent;
            if tracked != Tracked::Approaching {
                return (tracked, iterations);
            }
        }
        self.outcome = Outcome::NotConverged;
        (Tracked::NotConverged, iterations)
    }
}
