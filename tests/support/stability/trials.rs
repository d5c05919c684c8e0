//! Random poses, found from home by us and by others.

use hexad::analysis::assembly_proof::all_modes;
use hexad::model::forward_kinematics::{Outcome, Tracker, TrackingResult, refine};
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::rigid::Pose;
use hexad::model::task::TaskState;

use super::rivals;
use super::rivals::Update;

/// More than the largest rotation of a pose from home, 60 degrees about each axis \[rad\].
const MAX_TURN_RAD: f64 = 2.0;

/// Farther apart than this (radian, or radius) are two poses.
const APART: f64 = 1e-5;

/// Largest shift of a pose from home, in radii.
const SHIFT: f64 = 0.3;

/// Poses on the way from home that are looked at for [`within_reach`].
const WAY: u32 = 40;

/// Who finds the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    Hexad,
    Rival(Update),
}

/// How a trial ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    Right,
    /// The method says that it has no pose.
    Failed,
    /// Another pose with the same lengths.
    Wrong,
}

/// X of a pose, up to `angle` \[rad\] from home on every axis, by number.
pub fn pose(machine: &Machine, angle: f64, number: u64) -> [f64; 6] {
    let mut random = Random::new(number.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 2008);
    let shift = SHIFT * machine.joints.radius_m;
    let sizes = [angle, angle, angle, shift, shift, shift];
    std::array::from_fn(|i| machine.home[i] + sizes[i] * random.signed())
}

/// R and C of X.
pub fn rigid(x: [f64; 6]) -> Pose {
    TaskState::at_rest(x).motion().pose
}

/// Finds the pose of X by its lengths, from home.
pub fn trial(machine: &Machine, method: Method, x: [f64; 6]) -> End {
    let lengths = leg_lengths(machine, &rigid(x));
    let found = match method {
        Method::Hexad => {
            let mut tracker = Tracker::new(machine, rigid(machine.home));
            (tracker.find(machine, &lengths).0 == TrackingResult::Found).then_some(*tracker.pose())
        }
        Method::Rival(update) => {
            rivals::solve(machine, update, &machine.home, &lengths).map(|(x, _)| rigid(x))
        }
    };
    match found {
        None => End::Failed,
        Some(found) if machine.joints.distance(&found, &rigid(x)) < APART => End::Right,
        Some(_) => End::Wrong,
    }
}

/// Whether a search around home, as `hexad check` makes it, finds that the lengths of X have several poses on the
/// side of home: what start-up has to ask before it believes one of them.
pub fn ambiguous(machine: &Machine, x: [f64; 6]) -> bool {
    let center = rigid(machine.home);
    let home = KinematicState::new(machine, center).sensitivity().determinant;
    let found = all_modes(machine, &leg_lengths(machine, &rigid(x)), &center.rotation, MAX_TURN_RAD).poses;
    found.iter().filter(|mode| mode.sensitivity().determinant * home > 0.0).count() > 1
}

/// A step of the true pose from X, of any size up to a radian and a radius, that the loop sees as two
/// measurements, one after the other: whether it follows, refuses, or is deceived.
pub fn step(machine: &Machine, x: [f64; 6], number: u64) -> End {
    let from = rigid(x);
    let to = pose(machine, 1.0, number.wrapping_add(1 << 40));
    // As many small ones as large ones.
    let share = 10_f64.powf(-4.0 * (number % 1000) as f64 / 1000.0);
    let away: [f64; 6] = std::array::from_fn(|i| x[i] + share * (to[i] - machine.home[i]));
    let mut kinematic_state = KinematicState::new(machine, from);
    let side = kinematic_state.sensitivity().determinant;
    let report = refine(machine, &mut kinematic_state, &leg_lengths(machine, &rigid(away)));
    assert!(kinematic_state.sensitivity().determinant * side >= 0.0, "across a singular pose from {x:?}");
    match report.outcome {
        Outcome::Solved if machine.joints.distance(kinematic_state.pose(), &rigid(away)) < APART => {
            End::Right
        }
        Outcome::Solved => End::Wrong,
        _ => End::Failed,
    }
}

/// Whether the platform gets to X from home, on the straight way of the coordinates, without a singular pose.
pub fn within_reach(machine: &Machine, x: [f64; 6]) -> bool {
    let positive = |step: u32| {
        let share = f64::from(step) / f64::from(WAY);
        let way = std::array::from_fn(|i| machine.home[i] + share * (x[i] - machine.home[i]));
        KinematicState::new(machine, rigid(way)).sensitivity().determinant > 0.0
    };
    let at_home = positive(0);
    (1..=WAY).all(|step| positive(step) == at_home)
}
