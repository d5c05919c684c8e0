//! Ambiguous starts: rest poses of the usable region whose leg lengths another permitted pose has, too.
//!
//! A random walk from home visits the region: a step turns or shifts the platform within an interval, which shrinks until the pose is
//! usable (R. M. Neal, Slice sampling, 2003). [`super::assembly_proof`] decides each pose; poses in between are not searched. The poses are the
//! same in every run, and a longer search begins with the poses of a shorter one.

use core::f64::consts::PI;
use core::fmt;

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

use super::assembly_modes::other_permitted_modes;
use super::clearance::Clearance;
use crate::text::numbers::significant;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::random::Random;
use hexad_core::model::rigid::{Pose, Twist};

/// First interval of a step, in radii and in shares of the permitted rotation: across most regions.
const WALK_STEP: f64 = 4.0;
/// Pairs of steps from a pose to the next.
const STEP_PAIRS_PER_POSE: usize = 3;
/// Bound on the attempts of a step. About ten are usual for strokes of a thousandth of the radius.
const MAX_ATTEMPTS_PER_STEP: usize = 40;

/// Permitted rotation beyond which fewer poses are searched, as each takes longer.
const USUAL_ROTATION_RAD: f64 = PI / 6.0;

/// Result of a search of rest poses for other permitted poses with the same lengths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OtherPoseSearch {
    /// Rest poses of the usable region, of which home is one.
    pub poses: usize,
    /// Those with another permitted pose.
    pub ambiguous_poses: usize,
    /// Largest rotation from home of all these poses.
    pub largest_rotation_rad: f64,
    /// Smallest rotation from home of those with another permitted pose.
    pub ambiguous_from_rad: Option<f64>,
    /// Whether it is proved that home has no other permitted pose than those found.
    pub proved_at_home: bool,
    /// Nearest other permitted pose of home.
    pub at_home: Option<PoseDistance>,
    /// Nearest other permitted pose of any of these poses.
    pub nearest: Option<PoseDistance>,
}

/// Distance to another pose with the same lengths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PoseDistance {
    /// See [`Joints::distance`](hexad_core::model::machine::Joints::distance).
    #[serde(skip)]
    distance: f64,
    /// Rotation between the two.
    pub rotation_rad: f64,
    /// Shift of C.
    pub shift_m: f64,
}

impl OtherPoseSearch {
    /// Searches so many rest poses, fewer for a large permitted rotation; home alone if it is not usable.
    pub fn new(machine: &Machine, clearance: &Clearance, usual_count: usize) -> Self {
        let count = (usual_count as f64 * relative_search_density(machine).powi(2)) as usize;
        let (poses, home) = (rest_poses(machine, clearance, count), machine.home_pose());
        let rotation = |pose: &Pose| home.displacement_to(pose).angular.norm();
        let found: Vec<_> = poses.par_iter().map(|pose| nearest_permitted(machine, pose)).collect();
        let ambiguous = || poses.iter().zip(&found).filter(|(_, other)| other.is_some());
        Self {
            poses: poses.len(),
            ambiguous_poses: ambiguous().count(),
            largest_rotation_rad: poses.iter().map(rotation).fold(0.0, f64::max),
            ambiguous_from_rad: ambiguous().map(|(pose, _)| rotation(pose)).min_by(f64::total_cmp),
            proved_at_home: other_permitted_modes(machine, &KinematicState::new(machine, home))
                .is_proved_complete,
            at_home: found.first().copied().flatten(),
            nearest: nearest(found.into_iter().flatten()),
        }
    }
}

/// Poses along an axis that are worth their time, relative to a machine with the usual rotation.
pub fn relative_search_density(machine: &Machine) -> f64 {
    (USUAL_ROTATION_RAD / machine.max_rotation_rad).min(1.0)
}

fn nearest(found: impl Iterator<Item = PoseDistance>) -> Option<PoseDistance> {
    found.min_by(|a, b| a.distance.total_cmp(&b.distance))
}

/// The nearest other permitted pose with the lengths of a pose.
pub fn nearest_permitted(machine: &Machine, pose: &Pose) -> Option<PoseDistance> {
    let others = other_permitted_modes(machine, &KinematicState::new(machine, *pose));
    nearest(others.poses.iter().map(|other| {
        let way = pose.displacement_to(other.pose());
        let distance = machine.joints.distance(pose, other.pose());
        PoseDistance { distance, rotation_rad: way.angular.norm(), shift_m: way.linear.norm() }
    }))
}

/// Home, and poses of the usable region that are turned from it by at most the permitted rotation.
fn rest_poses(machine: &Machine, clearance: &Clearance, count: usize) -> Vec<Pose> {
    let home = machine.home_pose();
    let pose = |(turn, shift): (Vector3<f64>, Vector3<f64>)| {
        // Small rotations are as frequent as large ones.
        let angular = turn * (machine.max_rotation_rad * turn.norm_squared());
        home.displaced(&Twist { angular, linear: shift * machine.joints.radius_m })
    };
    let is_usable = |at: (Vector3<f64>, _)| at.0.norm() <= 1.0 && clearance.violation_at(&pose(at)).is_none();
    let (mut random, mut here) = (Random::new(1), (Vector3::zeros(), Vector3::zeros()));
    if !is_usable(here) {
        return vec![home];
    }
    let mut next = || {
        for (turns, shifts) in [(1.0, 0.0), (0.0, 1.0)].repeat(STEP_PAIRS_PER_POSE) {
            let direction = Vector3::from_fn(|_, _| random.signed());
            let mut low = -WALK_STEP * random.uniform();
            let mut high = low + WALK_STEP;
            for _ in 0..MAX_ATTEMPTS_PER_STEP {
                let size = low + (high - low) * random.uniform();
                let there = (here.0 + direction * (turns * size), here.1 + direction * (shifts * size));
                if is_usable(there) {
                    here = there;
                    break;
                }
                *(if size < 0.0 { &mut low } else { &mut high }) = size;
            }
        }
        pose(here)
    };
    core::iter::once(home).chain((1..count).map(|_| next())).collect()
}

impl fmt::Display for PoseDistance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [rotation_deg, shift_m] = [self.rotation_rad.to_degrees(), self.shift_m].map(significant);
        write!(f, "{rotation_deg} deg and {shift_m} m away")
    }
}

impl fmt::Display for OtherPoseSearch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let deg = |rad: f64| significant(rad.to_degrees());
        let none = if self.proved_at_home { "none (proved)" } else { "none found" };
        let at_home = self.at_home.map_or(none.into(), |other| other.to_string());
        write!(f, "at home {at_home}; in the usable region ")?;
        let Self { poses, ambiguous_poses, largest_rotation_rad, .. } = self;
        let (Some(nearest), Some(from)) = (&self.nearest, self.ambiguous_from_rad.map(deg)) else {
            let most = deg(*largest_rotation_rad);
            return write!(f, "none found up to {most} deg (searched, {poses} poses)");
        };
        write!(f, "from {nearest} on; some starts are ambiguous from {from} deg of rotation of home on ")?;
        write!(f, "(searched, {ambiguous_poses} of {poses} poses)")
    }
}
