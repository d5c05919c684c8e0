//! Assembly modes: poses with the same leg lengths, found off line from many starts.
//!
//! From each start the method of Levenberg and Marquardt minimises `sum (L_i(pose) - L_i)^2`; equal results count once.
//! Up to 40 real poses share six lengths (Dietmaier, 1998). Nothing proves that none is missing: more starts find more.
//! The starts are the same in every run.

use core::f64::consts::{FRAC_PI_2, PI};
use core::fmt;

use nalgebra::{Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use crate::model::LEGS;
use crate::model::forward_kinematics::{Tracker, TrackingResult};
use crate::model::inverse_geometry::leg_lengths;
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::{Actuator, Machine};
use crate::model::random::Random;
use crate::model::rigid::{Pose, Twist};

/// Bound on the steps from a start; most need ten to twenty.
const MAX_STEPS_PER_START: usize = 400;

/// Largest norm of the residual of a solution, as a share of the radius: rounding.
const LENGTH_TOLERANCE: f64 = 1e-12;

/// Distance (radian, or radius) below which two poses are the same.
const SAME_POSE_DISTANCE: f64 = 1e-7;

/// First damping as a share of the usual largest eigenvalue of `J^T J`; then its factor after each step that succeeds or fails.
const FIRST_DAMPING: f64 = 1e-2;
const DAMPING_DECREASE: f64 = 0.2;
const DAMPING_INCREASE: f64 = 5.0;

/// Largest rotation and shift of the starts of [`other_modes`]: modes further away are not confused with the pose.
const SEARCH_TURN_RAD: f64 = FRAC_PI_2;
const SEARCH_SHIFT_RADII: f64 = 2.0;
/// Starts of [`other_modes`]: a tenth of a second on two processors.
const START_COUNT: u64 = 2000;

/// Distance (radian, or radius) within which another mode may be the platform's true pose.
const CONFUSABLE_DISTANCE: f64 = 0.5;

/// Region of the starts of a search.
#[derive(Clone, Copy, Debug)]
pub struct SearchRegion {
    /// Middle of the region.
    pub center: Pose,
    /// Largest rotation from it \[rad\]; pi for all orientations.
    pub turn: f64,
    /// Largest displacement along each axis \[m\].
    pub shift: f64,
}

/// The poses with these lengths \[m\] that are found from so many starts, in the order of the starts.
///
/// ```
/// use hexad::analysis::assembly_modes::{SearchRegion, find_modes};
/// use hexad::model::inverse_geometry::leg_lengths;
/// # let machine = hexad::config::Config::load("config/tsai2000.toml".as_ref()).unwrap().machine;
/// let home = machine.home_pose();
/// let region = SearchRegion { center: home, turn: 1.0, shift: 0.5 };
/// let lengths = leg_lengths(&machine, &home);
/// let modes = find_modes(&machine, &lengths, &region, 100);
/// assert!(modes.iter().any(|mode| machine.joints.distance(mode.pose(), &home) < 1e-6));
/// ```
pub fn find_modes(
    machine: &Machine,
    lengths: &[f64; LEGS],
    region: &SearchRegion,
    starts: u64,
) -> Vec<KinematicState> {
    let ends = (0..starts).into_par_iter().map(|k| solve(machine, lengths, start(region, k)));
    let mut found: Vec<KinematicState> = vec![];
    for kinematic_state in ends.collect::<Vec<_>>().into_iter().flatten() {
        let size = |other: &KinematicState| machine.joints.distance(kinematic_state.pose(), other.pose());
        if found.iter().all(|other| size(other) > SAME_POSE_DISTANCE) {
            found.push(kinematic_state);
        }
    }
    found
}

/// Another assembly mode of a pose.
#[derive(Clone, Copy, Debug)]
pub struct OtherMode {
    /// Distance from the pose, see [`Joints::distance`](crate::model::machine::Joints::distance).
    pub distance: f64,
    turn_deg: f64,
    shift_m: f64,
    /// Every path between the two crosses a singular pose.
    beyond_singularity: bool,
    /// Whether the stroke does not exclude a path between the two.
    is_in_reach: bool,
}

impl OtherMode {
    /// Whether one may be confused with the other: it is near, and the legs may lead there.
    pub fn is_nearby(&self) -> bool {
        self.distance < CONFUSABLE_DISTANCE && self.is_in_reach
    }
}

impl fmt::Display for OtherMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { turn_deg, shift_m, beyond_singularity, .. } = self;
        let not = if *beyond_singularity { "" } else { "NOT " };
        write!(f, "{turn_deg:.1} deg and {shift_m:.3} m away, {not}across a singular pose")
    }
}

/// The other assembly modes of a pose that are found around it, the nearest first.
pub fn other_modes(machine: &Machine, here: &KinematicState) -> Vec<OtherMode> {
    let center = *here.pose();
    let region =
        SearchRegion { center, turn: SEARCH_TURN_RAD, shift: SEARCH_SHIFT_RADII * machine.joints.radius };
    let found = find_modes(machine, &here.lengths(machine), &region, START_COUNT);
    let is_in_reach = !is_confined(machine, here);
    let other = |there: &KinematicState| {
        let way = center.displacement_to(there.pose());
        OtherMode {
            distance: machine.joints.distance(&center, there.pose()),
            turn_deg: way.angular.norm().to_degrees(),
            shift_m: way.linear.norm(),
            beyond_singularity: there.sensitivity().determinant * here.sensitivity().determinant < 0.0,
            is_in_reach,
        }
    };
    let mut others: Vec<_> = found.iter().map(other).collect();
    others.retain(|other| other.distance > here.sensitivity().trusted_step);
    others.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    others
}

/// Whether the stroke leads from a pose to no other one with the same lengths. So it is if none of the poses that it leads to is
/// singular, because each of them is then the only one with its lengths. Examined are the straight ways of the lengths to
/// the 64 corners of the stroke, not those in between.
fn is_confined(machine: &Machine, here: &KinematicState) -> bool {
    let Actuator { min_length, max_length, .. } = machine.actuator;
    (0..1_u32 << LEGS).all(|corner| {
        let end = |leg: usize| if corner & (1 << leg) == 0 { min_length } else { max_length };
        let mut tracker = Tracker::new(machine, *here.pose());
        tracker.find(machine, &core::array::from_fn(end)).0 == TrackingResult::Found
    })
}

/// The start with this number.
fn start(region: &SearchRegion, number: u64) -> Pose {
    let mut random = Random::new(number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let mut vector = || Vector3::from_fn(|_, _| 2.0 * random.uniform() - 1.0);
    let turn = vector() * region.turn.min(PI);
    region.center.displaced(&Twist { angular: turn, linear: vector() * region.shift })
}

/// The pose with these lengths that is found from a start.
fn solve(machine: &Machine, lengths: &[f64; LEGS], start: Pose) -> Option<KinematicState> {
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
