//! Examination of the machine at home: drives, limits, legs, gravity.

use super::Examiner;
use crate::analysis::drive_capability::DriveCapability;
use crate::analysis::leg_crossing::{CrossingKind, LegCrossing, leg_crossings};
use crate::config::machine::rounded;
use crate::text::numbers::significant;
use hexad_core::control::constants::MAX_HOLDING_SHARE;
use hexad_core::model::LEGS;
use hexad_core::model::machine::Machine;
use nalgebra::Vector3;

/// Largest cosine between gravity and the direction from base to platform, for a platform that stands on its legs:
/// 120 deg.
const MAX_STANDING_COSINE: f64 = -0.5;

pub(super) fn examine(examiner: &mut Examiner) {
    let machine = &examiner.config.machine;
    let pose = machine.home_pose();
    let Some(drives) = DriveCapability::new(machine, &pose) else { return };
    let Some((leg, force)) = examiner.largest_holding_force(&pose) else { return };
    examine_holding(examiner, leg, force, "at home");
    if force <= MAX_HOLDING_SHARE * machine.actuator.weakest_available_force_n() {
        examine_limits(examiner, &drives);
    }
    for crossing in leg_crossings(machine, &pose) {
        examine_crossing(examiner, &crossing);
    }
    examine_gravity(examiner);
}

/// Rejects drives that cannot hold the platform with a margin. The leg counts from 0.
pub(super) fn examine_holding(examiner: &mut Examiner, leg: usize, force: f64, place: &str) {
    let actuator = &examiner.config.machine.actuator;
    let (limit, available) = (actuator.max_force_n, actuator.weakest_available_force_n());
    if force > MAX_HOLDING_SHARE * available {
        let gravity = match examiner.cone_rad.to_degrees() {
            0.0 => String::new(),
            angle => format!(" with gravity up to {} deg from gravity_m_s2", significant(angle)),
        };
        let bound = format!(
            "must be at least {} to hold the platform: leg {} needs {} N {place}{gravity}, {:.0} % of the limit, and at most {:.0} % may be needed",
            rounded((force / MAX_HOLDING_SHARE * limit / available).ceil()),
            leg + 1,
            rounded(force),
            100.0 * force / available,
            100.0 * MAX_HOLDING_SHARE,
        );
        examiner.error("actuator.max_force_n", format!("{limit}"), bound);
    }
}

/// Rejects accelerations that the drives cannot give at home, each alone; warns of those that they cannot give together, and of
/// velocities beyond the rate of the legs, which the reference keeps in any case.
fn examine_limits(examiner: &mut Examiner, drives: &DriveCapability) {
    let config = examiner.config;
    let (limits, force) =
        (&config.deployment.limits.reference, config.machine.actuator.weakest_available_force_n());
    let (linear, angular) = (limits.position.acceleration, limits.orientation.acceleration);
    let alone = [
        ("limits.acceleration_m_s2", linear, drives.max_linear_acceleration(force, 0.0)),
        ("limits.acceleration_rad_s2", angular, drives.angular_acceleration(force, 0.0)),
    ];
    let mut is_possible = true;
    for (key, value, possible) in alone {
        if value > possible {
            is_possible = false;
            let bound = format!(
                "must be at most {}, which the drives can give at home in every direction",
                down(possible)
            );
            examiner.error(key, format!("{value}"), bound);
        }
    }
    let together = drives.angular_acceleration(force, linear);
    if is_possible && angular > together {
        let bound = if together > 0.0 {
            format!("with limits.acceleration_m_s2 = {linear} the drives can give {} at home", down(together))
        } else {
            format!(
                "with limits.acceleration_m_s2 = {linear} the drives can give none in the worst direction at home"
            )
        };
        examiner.warn("limits.acceleration_rad_s2", format!("{angular}"), bound);
    }
    let velocities = [
        ("limits.velocity_m_s", limits.position.velocity, drives.velocity()),
        ("limits.velocity_rad_s", limits.orientation.velocity, drives.angular_velocity()),
    ];
    for (key, value, possible) in velocities {
        if value > possible {
            let bound = format!(
                "the legs allow {} at home (actuator.max_rate_m_s), which the reference keeps",
                down(possible)
            );
            examiner.warn(key, format!("{value}"), bound);
        }
    }
}

fn examine_crossing(examiner: &mut Examiner, crossing: &LegCrossing) {
    let LegCrossing { legs: [first, second], kind, distance_m, exchanged_m } = crossing;
    let (first, second) = (first + 1, second + 1);
    let key = format!("leg[{second}].platform_m");
    let [distance, exchanged] = [distance_m, exchanged_m].map(|metres| format!("{:.1} mm", 1e3 * metres));
    match kind {
        CrossingKind::Meeting => examiner.error(
            &key,
            format!("leg {second} meets leg {first}, {distance} apart at home"),
            format!("legs must not cross; exchanged on the platform they are {exchanged} apart: check the order of the joints"),
        ),
        CrossingKind::Swapped => examiner.warn(
            &key,
            format!("leg {second} passes leg {first} at {distance}"),
            format!(
                "with the joints of both exchanged on the platform the legs would be shorter, and {exchanged} apart: check the order \
                 of the joints"
            ),
        ),
    }
}

/// Warns if gravity does not press the platform onto its legs.
fn examine_gravity(examiner: &mut Examiner) {
    let machine = &examiner.config.machine;
    let up = platform_from_base(machine);
    let cosine = machine.gravity_m_s2.dot(&up) / (machine.gravity_m_s2.norm() * up.norm());
    if cosine > MAX_STANDING_COSINE {
        let value = format!("{:?}", <[f64; 3]>::from(machine.gravity_m_s2));
        let bound = if cosine > -MAX_STANDING_COSINE {
            "points from the base to the platform at home: the platform hangs; else check its sign, or home"
        } else {
            "is across the direction from the base to the platform at home; check its axis, or home"
        };
        examiner.warn("gravity_m_s2", value, bound);
    }
}

/// From the mean of the joints on the base to that of those on the platform at home.
fn platform_from_base(machine: &Machine) -> Vector3<f64> {
    let (joints, home) = (&machine.joints, machine.home_pose());
    let [base, platform] = [&joints.base, &joints.platform]
        .map(|lanes| joints.triples.unpack_vectors(lanes).iter().sum::<Vector3<f64>>() / LEGS as f64);
    home.position + home.rotation * platform - base
}

/// A bound rounded down, so that the number in the message is one that is accepted.
fn down(x: f64) -> f64 {
    rounded(x * (1.0 - 5e-6))
}
