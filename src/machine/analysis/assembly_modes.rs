//! Assembly modes: the poses with the same leg lengths, and which of them the machine permits.
//!
//! Up to 40 real poses share six lengths (Dietmaier, 1998). [`super::assembly_proof`] finds them, and proves that none is missing.

use core::f64::consts::FRAC_PI_2;
use core::fmt;

use super::assembly_proof::{Modes, all_modes};
use hexad_core::model::LEGS;
use hexad_core::model::forward_kinematics::{Tracker, TrackingResult};
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::{Actuator, Machine};
use hexad_core::model::rigid::Twist;

/// Largest rotation of [`other_modes`] from the pose: modes further away are not confused with it.
const SEARCH_TURN_RAD: f64 = FRAC_PI_2;

/// Distance (radian, or radius) within which another mode may be the platform's true pose, also across a singular pose.
const CONFUSABLE_DISTANCE: f64 = 0.5;

/// The poses with these lengths \[m\] on the side of home that are turned from it by at most `max_rotation_rad` of the machine.
///
/// ```
/// use hexad_machine::analysis::assembly_modes::permitted_modes;
/// use hexad_core::model::inverse_geometry::leg_lengths;
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let home = machine.home_pose();
/// let modes = permitted_modes(&machine, &leg_lengths(&machine, &home));
/// assert!(modes.is_proved_complete && machine.joints.distance(modes.poses[0].pose(), &home) < 1e-6);
/// ```
pub fn permitted_modes(machine: &Machine, lengths: &[f64; LEGS]) -> Modes {
    let home = machine.home_pose();
    let side = KinematicState::new(machine, home).sensitivity().determinant.signum();
    let mut modes = all_modes(machine, lengths, &home.rotation, machine.max_rotation_rad);
    modes.poses.retain(|it| {
        let turn = home.displacement_to(it.pose()).angular.norm();
        turn <= machine.max_rotation_rad && it.sensitivity().determinant * side > 0.0
    });
    modes
}

/// The poses of [`permitted_modes`] with the lengths of a pose, without it.
pub fn other_permitted_modes(machine: &Machine, here: &KinematicState) -> Modes {
    let mut modes = permitted_modes(machine, &here.lengths(machine));
    let distance = |it: &KinematicState| machine.joints.distance(here.pose(), it.pose());
    modes.poses.retain(|it| distance(it) > here.sensitivity().trusted_step);
    modes
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
    let found = all_modes(machine, &here.lengths(machine), &center.rotation, SEARCH_TURN_RAD).poses;
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
                && home.displacement_to(there.pose()).angular.norm() <= machine.max_rotation_rad,
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
    let Actuator { min_length_m, max_length_m, .. } = machine.actuator;
    (0..1_u32 << LEGS).all(|corner| {
        let end = |leg: usize| if corner & (1 << leg) == 0 { min_length_m } else { max_length_m };
        let mut tracker = Tracker::new(machine, *here.pose());
        tracker.find(machine, &core::array::from_fn(end)).0 == TrackingResult::Found
    })
}
