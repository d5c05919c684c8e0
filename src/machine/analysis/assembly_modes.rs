//! Assembly modes: poses with the same leg lengths, found off line from many starts.
//!
//! From each start the method of Levenberg and Marquardt minimises `sum (L_i(pose) - L_i)^2`; equal results count once.
//! Up to 40 real poses share six lengths (Dietmaier, 1998). Nothing proves that none is missing: more starts find more.
//! The starts are the same in every run.

use core::f64::consts::{FRAC_PI_2, PI};
use core::fmt;

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use hexad_core::model::LEGS;
use hexad_core::model::forward_kinematics::{Tracker, TrackingResult};
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::inverse_jacobian::leg_wrenches;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::{Actuator, Machine};
use hexad_core::model::random::Random;
use hexad_core::model::rigid::{Pose, Twist};

/// Bound on the steps from a start; most need ten to twenty.
const MAX_STEPS_PER_START: usize = 400;
/// The same from a start of [`permitted_modes`], whose position fits its orientation.
const MAX_STEPS_FROM_ORIENTATION: usize = 60;

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

/// Distance (radian, or radius) within which another mode may be the platform's true pose, also across a singular pose.
const CONFUSABLE_DISTANCE: f64 = 0.5;

/// Distance of the orientations from which [`permitted_modes`] starts, on a lattice of rotation vectors, and how far they reach beyond
/// the permitted rotation: 93 orientations, up to 40 degrees, for 30; one in 70,000 poses at 29.7 degrees was missed with 57, up to 32.
const LATTICE_RAD: f64 = 0.25;
const LATTICE_MARGIN_RAD: f64 = 0.175;

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
/// use hexad_machine::analysis::assembly_modes::{SearchRegion, find_modes};
/// use hexad_core::model::inverse_geometry::leg_lengths;
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
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
    let ends =
        (0..starts).into_par_iter().map(|k| solve(machine, lengths, start(region, k), MAX_STEPS_PER_START));
    distinct(machine, ends.collect::<Vec<_>>())
}

/// Each pose once.
fn distinct(
    machine: &Machine,
    ends: impl IntoIterator<Item = Option<KinematicState>>,
) -> Vec<KinematicState> {
    let mut found: Vec<KinematicState> = vec![];
    for kinematic_state in ends.into_iter().flatten() {
        let size = |other: &KinematicState| machine.joints.distance(kinematic_state.pose(), other.pose());
        if found.iter().all(|other| size(other) > SAME_POSE_DISTANCE) {
            found.push(kinematic_state);
        }
    }
    found
}

/// The poses with these lengths \[m\] on the side of home that are turned from it by at most `max_rotation` of the machine.
///
/// Searched, without proof: from each orientation of a lattice, at the one or two positions that fit its lengths best.
pub fn permitted_modes(machine: &Machine, lengths: &[f64; LEGS]) -> Vec<KinematicState> {
    let home = machine.home_pose();
    let side = KinematicState::new(machine, home).sensitivity().determinant.signum();
    let reach = (machine.max_rotation + LATTICE_MARGIN_RAD) / LATTICE_RAD;
    let axis = || -reach.ceil() as i32..=reach.ceil() as i32;
    let lattice =
        axis().flat_map(|x| axis().flat_map(move |y| axis().map(move |z| [x, y, z].map(f64::from))));
    let turns = lattice.map(Vector3::from).filter(|point| point.norm_squared() <= (reach * reach).ceil());
    let starts = turns.flat_map(|turn| {
        let turn = Twist { angular: turn * LATTICE_RAD, ..Twist::default() };
        positioned(machine, lengths, &home.displaced(&turn))
    });
    let ends = starts.map(|start| solve(machine, lengths, start, MAX_STEPS_FROM_ORIENTATION));
    let mut found = distinct(machine, ends);
    found.retain(|it| {
        let turn = home.displacement_to(it.pose()).angular.norm();
        turn <= machine.max_rotation && it.sensitivity().determinant * side > 0.0
    });
    found
}

/// The poses of [`permitted_modes`] with the lengths of a pose, without it.
pub fn other_permitted_modes(machine: &Machine, here: &KinematicState) -> Vec<KinematicState> {
    let mut found = permitted_modes(machine, &here.lengths(machine));
    let distance = |it: &KinematicState| machine.joints.distance(here.pose(), it.pose());
    found.retain(|it| distance(it) > here.sensitivity().trusted_step);
    found
}

/// Poses of an orientation that fit lengths best.
///
/// With `e_i` from the mean of the `d_i = A_i - R CB_i`, and u from there to C: `|u - e_i|^2 = L_i^2`. Less their mean these
/// equations are linear in u. The joints are nearly in a plane: across it u follows from the mean, on either side.
fn positioned(machine: &Machine, lengths: &[f64; LEGS], at: &Pose) -> [Pose; 2] {
    let [mut e, platform] = [&machine.joints.base, &machine.joints.platform]
        .map(|centers| machine.joints.triples.unpack_vectors(centers));
    e.iter_mut().zip(platform).for_each(|(base, platform)| *base -= at.rotation * platform);
    let mean = e.iter().sum::<Vector3<f64>>() / LEGS as f64;
    e.iter_mut().for_each(|e| *e -= mean);
    let excess = |(e, length): (&Vector3<f64>, &f64)| e.norm_squared() - length * length;
    let pairs = || e.iter().zip(lengths);
    let mean_excess = pairs().map(excess).sum::<f64>() / LEGS as f64;
    let moment: Matrix3<f64> = e.iter().map(|e| e * e.transpose()).sum();
    let right: Vector3<f64> = pairs().map(|pair| pair.0 * (0.5 * (excess(pair) - mean_excess))).sum();
    let eigen = moment.symmetric_eigen();
    let across = eigen.eigenvalues.imin();
    let mut u = Vector3::zeros();
    for (k, (value, axis)) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()).enumerate() {
        if k != across {
            u += axis * (axis.dot(&right) / value);
        }
    }
    let height = (-mean_excess - u.norm_squared()).max(0.0).sqrt();
    let normal = eigen.eigenvectors.column(across) * height;
    [normal, -normal].map(|normal| Pose { position: mean + u + normal, ..*at })
}

/// Another assembly mode of a pose.
#[derive(Clone, Copy, Debug)]
pub struct OtherMode {
    /// Distance from the pose, see [`Joints::distance`](hexad_core::model::machine::Joints::distance).
    pub distance: f64,
    turn_deg: f64,
    shift_m: f64,
    /// Every path between the two crosses a singular pose.
    beyond_singularity: bool,
    /// Whether the stroke does not exclude a path between the two.
    is_in_reach: bool,
    /// On the same side of the singular poses, and turned from home by no more than the joints permit.
    pub is_permitted: bool,
}

impl OtherMode {
    /// Whether the platform may be there instead: it may have been assembled so, or the legs may lead there from nearby.
    pub fn is_confusable(&self) -> bool {
        self.is_permitted || self.distance < CONFUSABLE_DISTANCE && self.is_in_reach
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
    let lengths = here.lengths(machine);
    let around = find_modes(machine, &lengths, &region, START_COUNT);
    let found = distinct(machine, around.into_iter().chain(permitted_modes(machine, &lengths)).map(Some));
    let (is_in_reach, home) = (!is_confined(machine, here), machine.home_pose());
    let turn_deg = |way: Twist| way.angular.norm().to_degrees();
    let other = |there: &KinematicState| {
        let way = center.displacement_to(there.pose());
        OtherMode {
            distance: machine.joints.distance(&center, there.pose()),
            turn_deg: turn_deg(way),
            shift_m: way.linear.norm(),
            beyond_singularity: there.sensitivity().determinant * here.sensitivity().determinant < 0.0,
            is_in_reach,
            is_permitted: there.sensitivity().determinant * here.sensitivity().determinant > 0.0
                && home.displacement_to(there.pose()).angular.norm() <= machine.max_rotation,
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
fn solve(machine: &Machine, lengths: &[f64; LEGS], start: Pose, most_steps: usize) -> Option<KinematicState> {
    let radius = machine.joints.radius;
    let scale = Vector6::new(1.0, 1.0, 1.0, radius, radius, radius);
    let residual = |pose: &Pose| Vector6::from(*lengths) - Vector6::from(leg_lengths(machine, pose));
    let (mut pose, mut rest) = (start, residual(&start));
    let mut damping = FIRST_DAMPING * radius * radius;
    for _ in 0..most_steps {
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
