//! Assembly modes: all poses found that have the same leg lengths. Off line, by many starts.
//!
//! From each start Levenberg's and Marquardt's method goes wherever the lengths fit; what is the same pose counts
//! once. Nothing proves that none is missing: more starts find
//! more. The starts are the same in every run.

use core::f64::consts::{FRAC_PI_2, PI};
use core::fmt;

use nalgebra::{Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use crate::model::inverse_geometry::leg_lengths;
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Pose, Twist};

/// Bound on the steps from a start; most need ten to twenty.
const MAX_STEPS_PER_START: usize = 400;

/// Lengths that fit to this share of the radius fit: rounding.
const LENGTH_TOLERANCE: f64 = 1e-12;

/// Poses this near to each other (radian, or radius) are one.
const SAME_POSE_DISTANCE: f64 = 1e-7;

/// First damping, as a share of the largest eigenvalue that `J^T J` usually has; then a factor for each step.
const FIRST_DAMPING: f64 = 1e-2;
const DAMPING_DECREASE: f64 = 0.2;
const DAMPING_INCREASE: f64 = 5.0;

/// Where [`others`] are looked for: further away nobody takes them for the pose itself.
const SEARCH_TURN_RAD: f64 = FRAC_PI_2;
/// In radii.
const SEARCH_SHIFT_RADII: f64 = 2.0;
/// A tenth of a second on two processors.
const START_COUNT: u64 = 2000;

/// Another pose this near (radian, or radius) may be where the platform is in truth.
const CONFUSABLE_DISTANCE: f64 = 0.5;

/// Where starts are spread.
#[derive(Clone, Copy, Debug)]
pub struct SearchRegion {
    /// In the middle.
    pub center: Pose,
    /// Largest rotation away from it \[rad\]; pi for all orientations.
    pub turn: f64,
    /// Largest displacement along each axis \[m\].
    pub shift: f64,
}

/// The poses with these lengths \[m\] that are found from so many starts, in the order of their finding.
pub fn find_modes(
    machine: &Machine,
    lengths: &[f64; LEGS],
    region: &SearchRegion,
    starts: u64,
) -> Vec<KinematicState> {
    let ends = (0..starts).into_par_iter().map(|k| settled(machine, lengths, start(region, k)));
    let mut found: Vec<KinematicState> = vec![];
    for kinematic_state in ends.collect::<Vec<_>>().into_iter().flatten() {
        let size = |other: &KinematicState| machine.joints.distance(kinematic_state.pose(), other.pose());
        if found.iter().all(|other| size(other) > SAME_POSE_DISTANCE) {
            found.push(kinematic_state);
        }
    }
    found
}

/// A pose that has the lengths of another one.
#[derive(Clone, Copy, Debug)]
pub struct OtherMode {
    /// Radian and radius together.
    pub distance: f64,
    turn_deg: f64,
    shift_m: f64,
    /// The way there crosses a singular pose, whatever it is.
    across: bool,
}

impl OtherMode {
    /// Whether one may be taken for the other.
    pub fn is_nearby(&self) -> bool {
        self.distance < CONFUSABLE_DISTANCE
    }
}

impl fmt::Display for OtherMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { turn_deg, shift_m, across, .. } = self;
        let not = if *across { "" } else { "NOT " };
        write!(f, "{turn_deg:.1} deg and {shift_m:.3} m away, {not}across a singular pose")
    }
}

/// OtherMode poses with the lengths of a pose that are found around it, the nearest first.
pub fn other_modes(machine: &Machine, here: &KinematicState) -> Vec<OtherMode> {
    let center = *here.pose();
    let region =
        SearchRegion { center, turn: SEARCH_TURN_RAD, shift: SEARCH_SHIFT_RADII * machine.joints.radius };
    let found = find_modes(machine, &here.lengths(machine), &region, START_COUNT);
    let other = |there: &KinematicState| {
        let way = center.displacement_to(there.pose());
        OtherMode {
            distance: machine.joints.distance(&center, there.pose()),
            turn_deg: way.angular.norm().to_degrees(),
            shift_m: way.linear.norm(),
            across: there.sensitivity().determinant * here.sensitivity().determinant < 0.0,
        }
    };
    let mut others: Vec<_> = found.iter().map(other).collect();
    others.retain(|other| other.distance > here.sensitivity().trusted_step);
    others.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    others
}

/// The start with this number.
fn start(region: &SearchRegion, number: u64) -> Pose {
    let mut state = number.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    // splitmix64, evenly in -1..1
    let mut unit = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-52) - 1.0
    };
    let mut vector = || Vector3::new(unit(), unit(), unit());
    let turn = vector() * region.turn.min(PI);
    region.center.displaced(&Twist { angular: turn, linear: vector() * region.shift })
}

/// Where the way from a start ends, if the lengths fit there.
fn settled(machine: &Machine, lengths: &[f64; LEGS], start: Pose) -> Option<KinematicState> {
    let radius = machine.joints.radius;
    let scale = Vector6::new(1.0, 1.0, 1.0, radius, radius, radius);
    let residual = |pose: &Pose| Vector6::from(*lengths) - Vector6::from(leg_lengths(machine, pose));
    let (mut pose, mut rest) = (start, residual(&start));
    let mut damping = FIRST_DAMPING * radius * radius;
    for _ in 0..MAX_STEPS_PER_START {
        if rest.norm() < LENGTH_TOLERANCE * radius {
            return Some(KinematicState::new(machine, pose));
        }
        let jacobian = leg_wrenches(machine, &pose).transpose() * Matrix6::from_diagonal(&scale);
        let normal = jacobian.tr_mul(&jacobian) + Matrix6::identity() * damping;
        let step = normal.cholesky()?.solve(&jacobian.tr_mul(&rest)).component_mul(&scale);
        let next = pose.displaced(&Twist::from_vector(&step));
        let left = residual(&next);
        if left.norm() < rest.norm() {
            (pose, rest, damping) = (next, left, damping * DAMPING_DECREASE);
        } else {
            damping *= DAMPING_INCREASE;
        }
    }
    None
}
