//! Checks of the geometry as a whole: six distinct legs that can hold the platform at home.
//!
//! Each check runs on the values that were read without error; a rejected value is NaN here, and NaN passes
//! (see [`super::reader`]).

use core::fmt;

use nalgebra::{Matrix3, Vector3};

use super::machine::{LegSection, rounded};
use super::reader::SectionReader;
use hexad_core::model::LEGS;
use hexad_core::model::forward_kinematics::MAX_CONDITION;
use hexad_core::model::inverse_geometry::{leg_directions, leg_lengths};
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::{Pose, Twist};
use hexad_core::model::task::TaskState;

/// Distance below which two points coincide, as a share of the joints' radius: a micrometre on a machine of a metre,
/// less than any joint can be placed or measured.
const COINCIDENCE_SHARE: f64 = 1e-6;

/// Least radius of a body's joints \[m\]: there is no machine of a micrometre, and its cube must have digits.
const MIN_JOINT_RADIUS_M: f64 = 1e-6;

/// Least sine of the angle between a leg at home and the first axis of its universal joint. Where they
/// are parallel the joint locks; at a milliradian the leg spins a thousand times faster than it swings.
const MIN_UNIVERSAL_SINE: f64 = 1e-3;

/// Distance of the poses around a singular home that are examined, in radians and as a share of the radius: far enough
/// to leave a pose that is singular by itself, near enough that every machine can reach them.
const EXAMINED_DISTANCE: f64 = 0.2;

/// Largest ratio of position \[m\] to angles \[rad\] of a home within the stroke that has them in the wrong order: C is near the
/// base origin, and turned by as much as legs are long.
const MAX_EXCHANGED_RATIO: f64 = 0.1;

/// Checks the joints, then the home pose.
pub(super) fn check(machine: &Machine, legs: &[LegSection], home: &SectionReader) {
    let base_spans = check_joints(legs, "base_m", |leg| leg.base_m);
    let platform_spans = check_joints(legs, "platform_m", |leg| leg.platform_m);

    let pose = machine.home_pose();
    let is_impossible = |exchanged: &ExchangedHome| {
        exchanged.margin_at_home_m < 0.0 || condition(machine, &pose) > MAX_CONDITION
    };
    if let Some(exchanged) = exchanged_home(machine).filter(is_impossible) {
        home.reject("pose", format!("must be {exchanged}"));
        return;
    }
    let complete = check_legs(machine, legs, &pose);
    let distinct = check_distinct(legs);
    if base_spans && platform_spans && complete && distinct {
        check_condition(machine, legs, &pose, home);
    }
}

/// Home whose angles are probably in the places of its positions.
pub(super) struct ExchangedHome {
    pose: [f64; 6],
    /// Least distance of a leg from the ends of the stroke at home as it was read \[m\]; negative beyond them.
    pub margin_at_home_m: f64,
}

impl fmt::Display for ExchangedHome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "alpha, beta, gamma [rad], then x, y, z [m]: at {:?} every leg is within its stroke",
            self.pose
        )
    }
}

/// Home with angles and positions exchanged, if every leg is further within its stroke there and home as it was read is
/// beyond the stroke or unusual.
pub(super) fn exchanged_home(machine: &Machine) -> Option<ExchangedHome> {
    let margin = |x: [f64; 6]| {
        let lengths = leg_lengths(machine, &TaskState::at_rest(x).motion().pose);
        lengths.map(|length| machine.actuator.margin(length)).into_iter().fold(f64::INFINITY, f64::min)
    };
    let [alpha, beta, gamma, x, y, z] = machine.home;
    let pose = [x, y, z, alpha, beta, gamma];
    let [margin_at_home_m, exchanged] = [machine.home, pose].map(margin);
    let is_unusual =
        Vector3::new(x, y, z).norm() < MAX_EXCHANGED_RATIO * Vector3::new(alpha, beta, gamma).norm();
    (exchanged > margin_at_home_m.max(0.0) && (margin_at_home_m < 0.0 || is_unusual))
        .then_some(ExchangedHome { pose, margin_at_home_m })
}

/// Root mean square distances of points from their mean.
struct Spread {
    /// Distance from the mean.
    radius: f64,
    /// Distance from the line that fits the points best.
    off_line: f64,
}

impl Spread {
    /// Spread of the points that are finite.
    fn of(points: impl Iterator<Item = Vector3<f64>> + Clone) -> Self {
        let points = points.filter(is_finite);
        let count = points.clone().count() as f64;
        let mean = points.clone().sum::<Vector3<f64>>() / count;
        let second_moment = points.map(|p| (p - mean) * (p - mean).transpose()).sum::<Matrix3<f64>>() / count;
        if count == 0.0 {
            return Self { radius: f64::NAN, off_line: f64::NAN };
        }
        let mut along: [f64; 3] = second_moment.symmetric_eigenvalues().into();
        along.sort_by(f64::total_cmp);
        let [least, middle, _] = along.map(|x| x.max(0.0));
        Self { radius: second_moment.trace().sqrt(), off_line: (least + middle).sqrt() }
    }
}

/// Rejects joints of one body that are all on one line or near one point. Returns false if they are.
fn check_joints(legs: &[LegSection], key: &str, joint: fn(&LegSection) -> Vector3<f64>) -> bool {
    let spread = Spread::of(legs.iter().map(joint));
    let least = COINCIDENCE_SHARE * spread.radius;
    let all_read = legs.len() >= LEGS && legs.iter().map(joint).all(|point| is_finite(&point));
    if let (true, Some(first)) = (all_read, legs.first()) {
        if spread.off_line <= least {
            let shown = format!("on one line with all others, to {:?} m", rounded(spread.off_line));
            let bound = format!(
                "must be off it by {COINCIDENCE_SHARE:?} of the radius: no leg resists a turn about it"
            );
            first.reader.reject_as(key, shown, bound);
            return false;
        }
        if spread.radius < MIN_JOINT_RADIUS_M {
            let shown = format!("one of six within {:?} m", rounded(spread.radius));
            first.reader.reject_as(
                key,
                shown,
                format!("must be within at least {MIN_JOINT_RADIUS_M:?} m (RMS)"),
            );
            return false;
        }
    }
    true
}

/// Rejects a leg whose two joint centres are those of another leg: both resist the same motion. Legs may share one centre, as on
/// 6-3 and 3-3 platforms.
fn check_distinct(legs: &[LegSection]) -> bool {
    let ends: [fn(&LegSection) -> Vector3<f64>; 2] = [|leg| leg.base_m, |leg| leg.platform_m];
    let least = ends.map(|end| COINCIDENCE_SHARE * Spread::of(legs.iter().map(end)).radius);
    let mut is_distinct = true;
    for (i, leg) in legs.iter().enumerate() {
        for (earlier, other) in legs.iter().enumerate().take(i) {
            let distances = ends.map(|end| (end(leg) - end(other)).norm());
            if distances.iter().zip(least).all(|(distance, least)| *distance < least) {
                let [base, platform] = distances.map(rounded);
                let shown = format!(
                    "{base:?} m from the base joint of leg[{}], {platform:?} m from its platform joint",
                    earlier + 1
                );
                let bound = format!(
                    "must be at least {COINCIDENCE_SHARE:?} of the joints' radius from one of them: legs may share one joint \
                     centre, not both"
                );
                leg.reader.reject_section(shown, bound);
                is_distinct = false;
            }
        }
    }
    is_distinct
}

/// Checks each leg at home. Returns whether all have been read and have a direction.
fn check_legs(machine: &Machine, legs: &[LegSection], pose: &Pose) -> bool {
    let least = COINCIDENCE_SHARE * Spread::of(legs.iter().map(|leg| leg.platform_m)).radius;
    let (shortest, longest) = (machine.actuator.min_length_m, machine.actuator.max_length_m);
    let stroke = format!("in [{shortest}, {longest}] (actuator.min_length_m, actuator.max_length_m)");
    let mut complete = true;
    for ((leg, length), direction) in
        legs.iter().zip(leg_lengths(machine, pose)).zip(leg_directions(machine, pose))
    {
        let shown = format!("{:?} m long at home", rounded(length));
        if length < least {
            leg.reader.reject_section(shown, "base_m and platform_m must not coincide at home");
        } else if shortest < longest && !(shortest..=longest).contains(&length) && !length.is_nan() {
            leg.reader.reject_section(shown, format!("must be {stroke}"));
        }
        let sine = leg.universal_axis.cross(&direction).norm();
        if sine < MIN_UNIVERSAL_SINE {
            leg.reader.reject_as(
                "universal_axis",
                format!("{:?} rad from the leg at home", rounded(sine)),
                format!("must be at least {MIN_UNIVERSAL_SINE} rad from it"),
            );
        }
        complete &= length >= least;
    }
    complete && legs.len() == LEGS
}

/// Rejects a singular home, and distinguishes it from a layout that is singular everywhere.
fn check_condition(machine: &Machine, legs: &[LegSection], pose: &Pose, home: &SectionReader) {
    let at_home = condition(machine, pose);
    if at_home <= MAX_CONDITION {
        return;
    }
    // Also reached where the condition is NaN.
    let best = around(machine, pose).map(|pose| condition(machine, &pose)).fold(f64::INFINITY, f64::min);
    let shown = format!("condition number {} of the legs' wrenches", rounded(at_home));
    if best <= MAX_CONDITION {
        let bound = format!(
            "must be at most {MAX_CONDITION}: the legs cannot hold the platform in every direction; poses \
             around it have {} at best",
            rounded(best)
        );
        home.reject_as("pose", shown, bound);
    } else if let Some(first) = legs.first() {
        let bound = format!(
            "must be at most {MAX_CONDITION} at some pose, and is {} at best around home: joints laid out \
             like this are singular everywhere",
            rounded(best)
        );
        first.reader.reject_section(shown, bound);
    }
}

/// Frobenius condition of the legs' wrenches at a pose, as everywhere: 6 is best.
fn condition(machine: &Machine, pose: &Pose) -> f64 {
    KinematicState::new(machine, *pose).sensitivity().condition
}

/// Poses in all directions from `pose`.
fn around(machine: &Machine, pose: &Pose) -> impl Iterator<Item = Pose> {
    let shift = EXAMINED_DISTANCE * machine.joints.radius_m;
    (0..1_u32 << LEGS).map(move |corner| {
        let sign = |axis: u32| if corner & (1 << axis) == 0 { 1.0 } else { -1.0 };
        // Different amounts, as symmetric motions may keep a layout singular.
        let angular = Vector3::new(sign(0), 0.7 * sign(1), 0.4 * sign(2)) * EXAMINED_DISTANCE;
        let linear = Vector3::new(0.5 * sign(3), 0.8 * sign(4), sign(5)) * shift;
        pose.displaced(&Twist { angular, linear })
    })
}

fn is_finite(point: &Vector3<f64>) -> bool {
    point.iter().all(|x| x.is_finite())
}
