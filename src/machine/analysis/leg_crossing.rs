//! Legs that meet each other at a pose, and joints on the platform that look swapped.
//!
//! A leg is the segment from its joint on the base to its joint on the platform. Two legs meet where their segments come closer than
//! a share of the joints' radius away from their ends: two joints beside each other are no crossing. The joints of two legs look
//! swapped where exchanging them on the platform would make both legs together shorter and keep them further apart: of two segments that
//! cross in a plane, the two that do not cross are shorter by the triangle inequality, and in space that holds about as long as
//! the legs pass each other nearer than their joints are. Legs that share a joint, as on 6-3 and 3-3 platforms, meet in it:
//! distances are measured without their share of it.
//!
//! Legs have no thickness here: whether cylinders touch each other is not examined.

use nalgebra::Vector3;

use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::Pose;

/// Distance below which two legs meet, as a share of the radius of the platform's joints: less than any cylinder is thick.
const MEETING_SHARE: f64 = 0.01;
/// Share of a leg at each of its ends that counts as its joint.
const END_SHARE: f64 = 0.05;
/// Least gain of distance by an exchange, as a factor: a layout that is nearly symmetric is no mistake.
const MIN_DISTANCE_GAIN: f64 = 1.25;

/// What is wrong with two legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrossingKind {
    /// They meet.
    Meeting,
    /// Their joints on the platform look swapped.
    Swapped,
}

/// Two legs, counted from 0, that are too near to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegCrossing {
    /// The legs, the lesser number first.
    pub legs: [usize; 2],
    /// What is wrong.
    pub kind: CrossingKind,
    /// Least distance between them \[m\].
    pub distance_m: f64,
    /// The same with their joints on the platform exchanged \[m\].
    pub exchanged_m: f64,
}

/// Crossings of all pairs of legs at a pose.
pub fn leg_crossings(machine: &Machine, pose: &Pose) -> Vec<LegCrossing> {
    let joints = &machine.joints;
    let base = joints.triples.unpack_vectors(&joints.base);
    let platform = joints.triples.unpack_vectors(&joints.platform);
    let platform = platform.map(|joint| pose.position + pose.rotation * joint);
    let legs: Vec<_> = base.into_iter().zip(platform).enumerate().collect();
    let pairs = legs
        .iter()
        .enumerate()
        .flat_map(|(k, first)| legs.iter().skip(k + 1).map(move |second| (first, second)));
    let least = MEETING_SHARE * joints.radius_m;
    pairs.filter_map(|((i, (a, b)), (j, (c, d)))| examine([*i, *j], [[a, b], [c, d]], least)).collect()
}

fn examine(legs: [usize; 2], [[a, b], [c, d]]: [[&Vector3<f64>; 2]; 2], least: f64) -> Option<LegCrossing> {
    let joint_size = END_SHARE * (b - a).norm().min((d - c).norm());
    let shared = |first: &Vector3<f64>, second: &Vector3<f64>| {
        if (first - second).norm() < joint_size { END_SHARE } else { 0.0 }
    };
    let span = (shared(a, c), 1.0 - shared(b, d));
    let (found, exchanged) = (closest([a, b], [c, d], span), closest([a, d], [c, b], span));
    let shorter = (a - d).norm() + (c - b).norm() < (a - b).norm() + (c - d).norm();
    let kind = if found.is_inside && found.distance < least {
        CrossingKind::Meeting
    } else if shorter && exchanged.distance > MIN_DISTANCE_GAIN * found.distance {
        CrossingKind::Swapped
    } else {
        return None;
    };
    Some(LegCrossing { legs, kind, distance_m: found.distance, exchanged_m: exchanged.distance })
}

/// Closest points of two segments.
struct Closest {
    distance: f64,
    /// Whether both are away from the ends.
    is_inside: bool,
}

/// Closest points of the parts of both that are within a span, 0 to 1 from their first to their last point (C. Ericson, Real-Time
/// Collision Detection, 2005, section 5.1.9).
fn closest([a, b]: [&Vector3<f64>; 2], [c, d]: [&Vector3<f64>; 2], (low, high): (f64, f64)) -> Closest {
    let (first, second) = (b - a, d - c);
    // The common normal of the two lines, else the nearest end.
    let (gap, f1, f2, cross) = (a - c, first.norm_squared(), second.norm_squared(), first.dot(&second));
    let determinant = f1 * f2 - cross * cross;
    let mut s = if determinant > 0.0 {
        ((cross * gap.dot(&second) - f2 * gap.dot(&first)) / determinant).clamp(low, high)
    } else {
        low
    };
    let t = ((first * s + gap).dot(&second) / f2).clamp(low, high);
    s = ((second * t - gap).dot(&first) / f1).clamp(low, high);
    let is_inside = [s, t].iter().all(|share| END_SHARE < *share && *share < 1.0 - END_SHARE);
    Closest { distance: (gap + first * s - second * t).norm(), is_inside }
}
