//! Forces of the drives along a stop: whether they keep their bounds at every pose within reach.
//!
//! At the centre of a ball the forces `Gamma_g + K a` are known for every acceleration a of the stop. A pose of
//! the ball is turned by at most t, its legs by at most q, and N changes by at most D (see
//! [`super::regularity`]). With W the wrench that N^-1 distributes, rho the largest norm of a row of N0^-1:
//!
//! ```text
//! Gamma - Gamma0 = N^-1 ((W - W0) - (N - N0) Gamma0)  + change along the leg
//! |Gamma_i - Gamma0_i| <= rho / (1 - B D) (|W - W0| + D |Gamma0|) + change along the leg
//! ```
//!
//! [`crate::model::force_changes`] has the bounds of these changes, and of forces of velocities. Friction has
//! its largest value.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use serde::{Deserialize, Serialize};

use fearless_simd::{Simd, f64x8, prelude::*};

use crate::control::constants::{Constants, MAX_HOLDING_SHARE};
use crate::control::reference::proof::tolerances::{FORCE_BETWEEN_KNOTS_RATIO, START_FORCE_RATIO};
use crate::control::reference::stop::acceleration_ranges::{AccelerationRange, AccelerationRanges};
use crate::control::reference::stop::pose_stop::StopKind;
use crate::control::signals::pair::Pair;
use crate::model::drive_loads::DriveLoads;
use crate::model::force_changes::{ForceBound, ForceChangeBounds, LargestMotion};
use crate::model::machine::Machine;
use crate::model::rigid::Pose;
use crate::model::triples::LegLanes;

/// Largest force of a stop, as a share of the force that every leg can get. The rest is for feedback.
const MAX_MOVING_SHARE: f64 = 0.95;
/// Most loads that are computed in a proof: it bounds the longest cycle.
const MAX_EVALUATIONS: u32 = 4;

/// Bounds of the forces \[N\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::control::reference) struct DriveForceBounds {
    /// At rest.
    pub holding_n: f64,
    /// In motion.
    pub moving_n: f64,
}

impl DriveForceBounds {
    /// Bounds for a platform within them.
    pub fn new(machine: &Machine) -> Self {
        let force = machine.actuator.weakest_available_force_n();
        Self { holding_n: MAX_HOLDING_SHARE * force, moving_n: MAX_MOVING_SHARE * force }
    }

    /// Relaxes the bounds if the drives hold more at a pose. It may be left by what they can give beyond that.
    /// Returns whether they hold more.
    pub fn relax_to(&mut self, constants: &Constants, loads: &DriveLoads) -> bool {
        let LegLanes(forces) = loads.holding;
        let actuator = &constants.machine().actuator;
        let (available, friction) =
            (actuator.weakest_available_force_n(), actuator.largest_coulomb_friction());
        let holding_n = largest(forces) + friction;
        let is_beyond = holding_n > self.holding_n;
        if is_beyond {
            let moving = holding_n + (MAX_MOVING_SHARE - MAX_HOLDING_SHARE) * available;
            *self = Self {
                holding_n: holding_n + START_FORCE_RATIO * available,
                moving_n: moving.min(available),
            };
        }
        is_beyond
    }

    /// The lesser of both bounds.
    pub fn tighter_of(&self, other: &Self) -> Self {
        Self { holding_n: self.holding_n.min(other.holding_n), moving_n: self.moving_n.min(other.moving_n) }
    }
}

/// Accelerations and largest velocities of a stop.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control::reference) struct StopDemand {
    pub accelerations: Pair<AccelerationRanges>,
    pub speeds: Pair<f64>,
}

impl StopDemand {
    fn largest(&self) -> LargestMotion {
        let Self { accelerations, speeds } = self;
        LargestMotion {
            angular_rad_s2: accelerations.angular.largest,
            linear_m_s2: accelerations.linear.largest,
            angular_velocity_rad_s: speeds.angular,
            velocity_m_s: speeds.linear,
        }
    }
}

/// Distances of a pose from the centre of a ball.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control::reference) struct CenterDistance {
    /// t, q and D.
    pub turn_rad: f64,
    pub turned_leg: f64,
    pub change: f64,
}

/// Loads of the drives at the centre of a ball.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct CenterLoads {
    loads: DriveLoads,
    /// Largest force at rest, and norm of these forces \[N\].
    holding: [f64; 2],
}

/// Forces of the drives in a ball. The loads are computed when they are first needed: strong drives need only
/// the bound for any pose.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::reference) struct BallLoads {
    /// B and rho.
    inverse_norm: f64,
    largest_row: f64,
    at_center: Option<CenterLoads>,
    center: Option<Pose>,
}

impl BallLoads {
    pub fn new(center: &Pose, inverse_norm: f64, largest_row_norm: f64) -> Self {
        Self { inverse_norm, largest_row: largest_row_norm, at_center: None, center: Some(*center) }
    }

    /// Computes the loads at the centre, if it is regular.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    fn evaluate(&mut self, constants: &Constants) {
        let loads = self.center.and_then(|center| DriveLoads::new(&constants.dynamics, &center));
        self.at_center = loads.map(|loads| {
            let LegLanes(forces) = loads.holding;
            CenterLoads { loads, holding: [largest(forces), norm(forces)] }
        });
    }

    /// Factor of a wrench at a distance from the centre.
    #[inline(always)]
    fn factor(&self, distance: &CenterDistance) -> f64 {
        self.largest_row / (1.0 - self.inverse_norm * distance.change)
    }

    /// Bound on a force at a distance from the centre, from the largest force and the norm there.
    #[inline(always)]
    fn largest_around(
        &self,
        [largest, norm]: [f64; 2],
        axial_norm: f64,
        change: &ForceBound,
        distance: &CenterDistance,
    ) -> f64 {
        largest
            + self.factor(distance) * (change.wrench + distance.change * (norm + axial_norm))
            + change.axial_n
    }

    /// Bound on a force at rest at a distance from the centre.
    #[inline(always)]
    fn largest_held(
        &self,
        center: &CenterLoads,
        changes: &ForceChangeBounds,
        distance: &CenterDistance,
    ) -> f64 {
        let change = changes.at_rest(distance.turn_rad, distance.turned_leg);
        let axial_norm = changes.axial_norm(&LargestMotion::default());
        self.largest_around(center.holding, axial_norm, &change, distance)
    }
}

fn largest(forces: [f64; 8]) -> f64 {
    forces.into_iter().map(f64::abs).fold(0.0, f64::max)
}

fn norm(forces: [f64; 8]) -> f64 {
    forces.iter().map(|force| force * force).sum::<f64>().sqrt()
}

/// Proof that the drives can give what a stop takes.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct ForceProof {
    demand: StopDemand,
    bounds: DriveForceBounds,
    /// Force at rest by which the bound may be exceeded between knots \[N\].
    held_between_knots: f64,
    /// Bound on the forces at any pose.
    at_any_pose: ForceBound,
    evaluations_left: u32,
    /// Ball that was used last, and the largest force of the stop at its centre and the norm there.
    at_center: Option<(usize, [f64; 2])>,
}

impl ForceProof {
    /// Proof for a stop in free space, or knot by knot.
    pub fn new(constants: &Constants, demand: StopDemand, bounds: DriveForceBounds, kind: StopKind) -> Self {
        let held_between_knots = match kind {
            StopKind::ReleaseFirst => 0.0,
            StopKind::BrakeAtOnce => FORCE_BETWEEN_KNOTS_RATIO * bounds.moving_n,
        };
        let at_any_pose = constants.force_changes.whole(&demand.largest());
        let evaluations_left = MAX_EVALUATIONS;
        Self { demand, bounds, held_between_knots, at_any_pose, evaluations_left, at_center: None }
    }

    /// Forgets the forces at the centre of a ball, because another ball replaces it.
    pub fn forget(&mut self) {
        self.at_center = None;
    }

    /// Whether the drives are strong enough whatever the pose, with the factor of a ball.
    #[inline(always)]
    fn is_generous(&self, ball: &BallLoads, distance: &CenterDistance) -> bool {
        let ForceBound { wrench, axial_n } = self.at_any_pose;
        ball.factor(distance) * wrench + axial_n <= self.bounds.holding_n
    }

    /// Loads at the centre of a ball, computed if the effort suffices.
    #[inline(always)]
    fn center_loads(&mut self, constants: &Constants, ball: &mut BallLoads) -> Option<CenterLoads> {
        if ball.at_center.is_none() && self.evaluations_left > 0 {
            self.evaluations_left -= 1;
            ball.evaluate(constants);
        }
        ball.at_center
    }

    /// Whether the drives can give what the stop takes, at every pose within a distance from the centre of a
    /// ball.
    #[inline(always)]
    pub fn holds<S: Simd>(
        &mut self,
        simd: S,
        constants: &Constants,
        (index, ball): (usize, &mut BallLoads),
        distance: &CenterDistance,
    ) -> bool {
        if self.is_generous(ball, distance) {
            return true;
        }
        let Some(center) = self.center_loads(constants, ball) else { return false };
        let peaks = match self.at_center {
            Some((known, peaks)) if known == index => peaks,
            _ => {
                let peaks = peaks(simd, &center.loads, &self.demand.accelerations);
                self.at_center.insert((index, peaks)).1
            }
        };
        let changes = &constants.force_changes;
        let CenterDistance { turn_rad, turned_leg, .. } = *distance;
        let motion = self.demand.largest();
        let (at_rest, moving) =
            (changes.at_rest(turn_rad, turned_leg), changes.moving(&motion, turn_rad, turned_leg));
        let change =
            ForceBound { wrench: at_rest.wrench + moving.wrench, axial_n: at_rest.axial_n + moving.axial_n };
        let axial_norm = changes.axial_norm(&motion);
        ball.largest_around(peaks, axial_norm, &change, distance) <= self.bounds.moving_n
            && ball.largest_held(&center, changes, distance)
                <= self.bounds.holding_n + self.held_between_knots
    }

    /// Whether the drives can hold the platform at a distance from the centre of a ball.
    #[inline(always)]
    pub fn is_held(
        &mut self,
        constants: &Constants,
        ball: &mut BallLoads,
        distance: &CenterDistance,
    ) -> bool {
        self.is_generous(ball, distance)
            || self.center_loads(constants, ball).is_some_and(|center| {
                ball.largest_held(&center, &constants.force_changes, distance) <= self.bounds.holding_n
            })
    }
}

/// Largest force of a leg under the accelerations, and a bound on the norm of all forces.
#[inline(always)]
fn peaks<S: Simd>(simd: S, loads: &DriveLoads, accelerations: &Pair<AccelerationRanges>) -> [f64; 2] {
    let load = |lanes: &LegLanes| f64x8::load_array(simd, lanes.0);
    let splat = |number: f64| f64x8::splat(simd, number);
    let [ax, ay, az, lx, ly, lz] = &loads.by_acceleration;
    let holding = load(&loads.holding);
    let (mut lowest, mut highest) = (holding, holding);
    for (columns, ranges) in [([ax, ay, az], &accelerations.angular), ([lx, ly, lz], &accelerations.linear)] {
        let [x, y, z] = columns;
        let (x, y, z) = (load(x), load(y), load(z));
        for AccelerationRange { direction, lowest: low, highest: high } in &ranges.ranges {
            let force = x * splat(direction.x) + y * splat(direction.y) + z * splat(direction.z);
            let (low, high) = (force * splat(*low), force * splat(*high));
            lowest += low.min(high);
            highest += low.max(high);
        }
    }
    let peaks = highest.max(-lowest);
    [largest(peaks.to_array()), norm(peaks.to_array())]
}
