//! What the geometry as a whole must be: six distinct legs that can hold the platform at home.
//!
//! Each check runs on what has been read soundly; a value that was refused is NaN here, and NaN passes
//! (see [`super::reader`]).

use nalgebra::{Matrix3, Vector3};

use super::machine::{Leg, rounded};
use super::reader::Reader;
use crate::model::forward_kinematics::MAX_CONDITION;
use crate::model::inverse_geometry::{leg_directions, leg_lengths};
use crate::model::inverse_jacobian::condition;
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Pose, Twist};
use crate::model::task::TaskState;

/// Points nearer than this share of the joints' radius are one point: a micrometre on a machine of a metre,
/// less than any joint can be placed or measured. The equations would allow two joints in one place, as on
/// the drawings of 6-3 platforms; a universal or spherical joint of two legs cannot be built.
const COINCIDENT: f64 = 1e-6;

/// Least radius of a body's joints \[m\]: there is no machine of a micrometre, and its cube must have digits.
const LEAST_RADIUS: f64 = 1e-6;

/// Least sine of the angle between a leg at home and the first axis of its universal joint. Where they
/// are parallel the joint locks; at a milliradian the leg spins a thousand times faster than it swings.
const LEAST_UNIVERSAL_SINE: f64 = 1e-3;

/// How far around home a singular layout is looked at, in radians and as a share of the radius: far enough that a
/// pose that is singular by itself is left, near enough that every machine gets there.
const AROUND: f64 = 0.2;

/// Checks the joints, then the home pose.
pub(super) fn check(machine: &Machine, legs: &[Leg], home: &Reader) {
    let base_spans = check_joints(legs, "base_m", |leg| leg.base);
    let platform_spans = check_joints(legs, "platform_m", |leg| leg.platform);

    let pose = TaskState::at_rest(machine.home).motion().pose;
    let complete = check_legs(machine, legs, &pose);
    if base_spans && platform_spans && complete {
        check_condition(machine, legs, &pose, home);
    }
}

/// Root mean square distances of points from their mean.
struct Spread {
    /// From the point itself.
    radius: f64,
    /// From the line that fits the points best.
    off_line: f64,
}

impl Spread {
    /// Of the points that have been read soundly.
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

/// Refuses joints of one body that are all on one line or about one point, else any two in one place. False
/// if on a line or about a point.
fn check_joints(legs: &[Leg], key: &str, joint: fn(&Leg) -> Vector3<f64>) -> bool {
    let spread = Spread::of(legs.iter().map(joint));
    let least = COINCIDENT * spread.radius;
    let all_read = legs.len() >= LEGS && legs.iter().map(joint).all(|point| is_finite(&point));
    if let (true, Some(first)) = (all_read, legs.first()) {
        if spread.off_line <= least {
            let shown = format!("on one line with all others, to {:?} m", rounded(spread.off_line));
            let bound =
                format!("must be off it by {COINCIDENT:?} of the radius: no leg resists a turn about it");
            first.reader.refuse_as(key, shown, bound);
            return false;
        }
        if spread.radius < LEAST_RADIUS {
            let shown = format!("one of six within {:?} m", rounded(spread.radius));
            first.reader.refuse_as(key, shown, format!("must be within at least {LEAST_RADIUS:?} m (RMS)"));
            return false;
        }
    }
    for (i, leg) in legs.iter().enumerate() {
        for (earlier, other) in legs.iter().enumerate().take(i) {
            let distance = (joint(leg) - joint(other)).norm();
            if distance < least {
                let shown = format!("{:?} m from leg[{}].{key}", rounded(distance), earlier + 1);
                let bound =
                    format!("must be at least {:?} m from it ({COINCIDENT:?} of the radius)", rounded(least));
                leg.reader.refuse_as(key, shown, bound);
            }
        }
    }
    true
}

/// Checks each leg at home. Returns whether all have been read and have a direction.
fn check_legs(machine: &Machine, legs: &[Leg], pose: &Pose) -> bool {
    let least = COINCIDENT * Spread::of(legs.iter().map(|leg| leg.platform)).radius;
    let (shortest, longest) = (machine.actuator.min_length, machine.actuator.max_length);
    let stroke = format!("in [{shortest}, {longest}] (actuator.min_length_m, actuator.max_length_m)");
    let mut complete = true;
    for ((leg, length), direction) in
        legs.iter().zip(leg_lengths(machine, pose)).zip(leg_directions(machine, pose))
    {
        let shown = format!("{:?} m long at home", rounded(length));
        if length < least {
            leg.reader.refuse_table(shown, "base_m and platform_m must not coincide at home");
        } else if shortest < longest && !(shortest..=longest).contains(&length) && !length.is_nan() {
            leg.reader.refuse_table(shown, format!("must be {stroke}"));
        }
        let sine = leg.universal_axis.cross(&direction).norm();
        if sine < LEAST_UNIVERSAL_SINE {
            leg.reader.refuse_as(
                "universal_axis",
                format!("{:?} rad from the leg at home", rounded(sine)),
                format!("must be at least {LEAST_UNIVERSAL_SINE} rad from it"),
            );
        }
        complete &= length >= least;
    }
    complete && legs.len() == LEGS
}

/// Refuses a singular home, and tells it from a layout that is singular everywhere.
fn check_condition(machine: &Machine, legs: &[Leg], pose: &Pose, home: &Reader) {
    let at_home = condition(machine, pose);
    if at_home <= MAX_CONDITION {
        return;
    }
    // Also where it is no number.
    let best = around(machine, pose).map(|pose| condition(machine, &pose)).fold(f64::INFINITY, f64::min);
    let shown = format!("condition number {} of the legs' wrenches", rounded(at_home));
    if best <= MAX_CONDITION {
        let bound = format!(
            "must be at most {MAX_CONDITION}: the legs cannot hold the platform in every direction; poses \
             around it have {} at best",
            rounded(best)
        );
        home.refuse_as("pose", shown, bound);
    } else if let Some(first) = legs.first() {
        let bound = format!(
            "must be at most {MAX_CONDITION} at some pose, and is {} at best around home: joints laid out \
             like this are singular everywhere",
            rounded(best)
        );
        first.reader.refuse_table(shown, bound);
    }
}

/// Poses in all directions from `pose`.
fn around(machine: &Machine, pose: &Pose) -> impl Iterator<Item = Pose> {
    let shift = AROUND * machine.joints.radius;
    (0..1_u32 << LEGS).map(move |corner| {
        let sign = |axis: u32| if corner & (1 << axis) == 0 { 1.0 } else { -1.0 };
        // Different amounts, for symmetric motions may keep a layout singular.
        let angular = Vector3::new(sign(0), 0.7 * sign(1), 0.4 * sign(2)) * AROUND;
        let linear = Vector3::new(0.5 * sign(3), 0.8 * sign(4), sign(5)) * shift;
        pose.displaced(&Twist { angular, linear })
    })
}

fn is_finite(point: &Vector3<f64>) -> bool {
    point.iter().all(|x| x.is_finite())
}
