//! What is claimed of every run under control: names, sentences, and how each is judged.
//!
//! A new property is an entry of [`PROPERTIES`]: the searches, the corpus and the table of docs/safety.md follow from it.

use hexad::control::controller::Output;
use hexad::control::parameters::{Parameters, ViolationPolicy};
use hexad::control::signals::limits::{DerivativeLimits, Limits};
use hexad::model::rigid::{Motion, Twist};
use nalgebra::Vector3;

use super::genome::{Genome, World, name};
use super::run::Faults;
use crate::extremes::{Quantity, REFERENCE_ALLOWANCE};
use crate::rig::Rig;

/// A cycle, after the platform has moved.
pub struct Moment<'a> {
    pub rig: &'a Rig,
    pub before: &'a Output,
    pub output: &'a Output,
    pub stop: Option<Stop>,
    pub faults: Faults,
    pub policy: ViolationPolicy,
    /// Between the references of both policies, while "stop" has refused no setpoint \[m\], \[rad\].
    pub policies_apart: Option<f64>,
}

/// A request for a stop under control, after which none for control came.
#[derive(Clone, Copy)]
pub struct Stop {
    /// When it came \[s\].
    pub at_s: f64,
    /// The longest that it may take until the state says so \[s\].
    pub longest_s: f64,
    /// The longest that the reference may move \[s\].
    pub planned_s: Option<f64>,
}

/// How a property is judged.
pub enum Judge {
    /// By the largest value of a quantity of the true motion, or of the reference.
    Motion(Quantity),
    /// In each cycle; minus infinity where it says nothing.
    Cycle(f64, fn(&Moment<'_>) -> f64),
}

/// A claim.
pub struct Property {
    pub name: &'static str,
    pub claim: &'static str,
    /// Where it is claimed.
    pub worlds: &'static [World],
    /// Whether it is claimed with sensors that freeze, too.
    pub with_frozen_sensors: bool,
    pub judge: Judge,
}

const EVERYWHERE: &[World] = &World::ALL;
const MODEL: &[World] = &[World::Model];

const fn of_motion(quantity: Quantity, claim: &'static str, worlds: &'static [World]) -> Property {
    Property {
        name: quantity.name(),
        claim,
        worlds,
        with_frozen_sensors: false,
        judge: Judge::Motion(quantity),
    }
}

const fn of_reference(quantity: Quantity, claim: &'static str) -> Property {
    Property { with_frozen_sensors: true, ..of_motion(quantity, claim, EVERYWHERE) }
}

/// Every property.
pub const PROPERTIES: [Property; 18] = [
    of_motion(Quantity::Velocity, "C is at most 2 % faster than `limits.velocity_m_s`", MODEL),
    of_motion(
        Quantity::AngularVelocity,
        "the platform turns at most 2 % faster than `limits.velocity_rad_s`",
        MODEL,
    ),
    of_motion(Quantity::LegRate, "no leg is more than 2 % faster than `actuator.max_rate_m_s`", MODEL),
    of_motion(
        Quantity::Acceleration,
        "the acceleration of C is at most 2 % above what reference and feedback may have together",
        MODEL,
    ),
    of_motion(Quantity::AngularAcceleration, "the same for the angular acceleration", MODEL),
    of_motion(Quantity::Stroke, "no leg reaches an end stop", MODEL),
    of_motion(Quantity::Envelope, "the platform stays within the envelope, to 50 um and 100 urad", MODEL),
    of_motion(Quantity::Condition, "the condition is at most 2 % above `limits.condition`", EVERYWHERE),
    of_motion(
        Quantity::Engaging,
        "while engaging the platform is within the following limits of the reference",
        MODEL,
    ),
    of_motion(
        Quantity::Following,
        "under control the platform is within the following limits of the reference",
        MODEL,
    ),
    of_reference(Quantity::ReferenceVelocity, "the reference keeps the limits of velocity"),
    of_reference(Quantity::ReferenceAcceleration, "the reference keeps the limits of acceleration"),
    of_reference(Quantity::ReferenceJerk, "the reference keeps the limits of jerk"),
    of_reference(Quantity::ReferenceStroke, "the reference stays within the stroke less its margin"),
    Property {
        name: "fault",
        claim: "under `on_violation = \"limit\"` no setpoint leads to a fault",
        worlds: MODEL,
        with_frozen_sensors: false,
        judge: Judge::Cycle(0.0, |moment| match moment.policy {
            ViolationPolicy::Stop => f64::NEG_INFINITY,
            ViolationPolicy::Limit => f64::from(moment.faults.count),
        }),
    },
    Property {
        name: "stop time",
        claim: "a stop at speed v ends in rest within v/A + 2.5 A/J + 55 ms, the longer of both",
        worlds: EVERYWHERE,
        with_frozen_sensors: true,
        judge: Judge::Cycle(1.0, |moment| {
            moment.stop.map_or(f64::NEG_INFINITY, |stop| (moment.rig.time_s() - stop.at_s) / stop.longest_s)
        }),
    },
    Property {
        name: "reference stop",
        claim: "the reference rests when the stop from its own v and a with A and J ends, or after 3.02 A/J (as much later where v and a are not in one line)",
        worlds: EVERYWHERE,
        with_frozen_sensors: true,
        judge: Judge::Cycle(1.0 + REFERENCE_ALLOWANCE, |moment| {
            let moves = moment.output.reference.is_some_and(|motion| motion.twist != Twist::default());
            let stop = moment.stop.filter(|_| moves).and_then(|stop| Some((stop.at_s, stop.planned_s?)));
            stop.map_or(f64::NEG_INFINITY, |(at_s, planned_s)| (moment.rig.time_s() - at_s) / planned_s)
        }),
    },
    Property {
        name: "policies",
        claim: "what \"stop\" accepts \"limit\" follows with the same reference, to 1e-9 m and rad, unless a bound is in the straight way to a target",
        worlds: EVERYWHERE,
        with_frozen_sensors: true,
        judge: Judge::Cycle(1e-9, |moment| moment.policies_apart.unwrap_or(f64::NEG_INFINITY)),
    },
];

/// Time to rest with the largest acceleration in the direction of a velocity v: that is released (A/J), which adds A^2/(2 J) to v, then
/// v + A^2/(2 J) is braked with A (v/A + A/(2 J)), and A is released (A/J); 55 ms to notice, settle and say so.
pub fn longest_stop_s(parameters: &Parameters, twist: &Twist) -> f64 {
    let time_s = |v: f64, of: &DerivativeLimits| v / of.acceleration + 2.5 * of.acceleration / of.jerk;
    let Limits { position, orientation, .. } = &parameters.limits;
    time_s(twist.linear.norm(), position).max(time_s(twist.angular.norm(), orientation)) + 0.055
}

/// Time in which a reference of this motion rests \[s\]: it releases a (|a|/J), by which v changes to v1 = v + a |a|/(2 J), and stops from v1
/// (v1/A + A/J, or 2 sqrt(v1/J) if A is not reached). Near a bound it brakes at once, or does so already: what is across v ends after
/// 3.02 A/J however small it is, and alone is in one line, too.
pub fn planned_stop_s(limits: &Limits, motion: &Motion) -> f64 {
    let time_s = |v: &Vector3<f64>, a: &Vector3<f64>, of: &DerivativeLimits| {
        let (ramp_s, release_s) = (of.acceleration / of.jerk, a.norm() / of.jerk);
        let v1 = (v + a * (0.5 * release_s)).norm();
        let straight_s = match v1 >= of.acceleration * ramp_s {
            true => v1 / of.acceleration + ramp_s,
            false => 2.0 * (v1 / of.jerk).sqrt(),
        };
        let is_straight = v.cross(a).norm() <= 1e-9 * v.norm() * of.acceleration;
        let (stop_s, across_s) = (release_s + straight_s, 3.02 * ramp_s);
        if is_straight { stop_s.max(across_s) } else { stop_s + across_s }
    };
    let Motion { twist, acceleration, .. } = motion;
    time_s(&twist.linear, &acceleration.linear, &limits.position).max(time_s(
        &twist.angular,
        &acceleration.angular,
        &limits.orientation,
    ))
}

impl Property {
    /// The largest value that is no violation.
    pub fn allowed(&self) -> f64 {
        match self.judge {
            Judge::Motion(quantity) => quantity.allowed(),
            Judge::Cycle(allowed, _) => allowed,
        }
    }

    /// Whether it is claimed of a run. With frozen sensors what the platform does depends on when they freeze: `motions` bounds it.
    pub fn is_claimed(&self, genome: &Genome) -> bool {
        self.worlds.contains(&genome.world) && (self.with_frozen_sensors || !genome.is_frozen())
    }

    /// Value in a cycle, or of the motion so far.
    pub fn value(&self, moment: &Moment<'_>) -> f64 {
        match self.judge {
            Judge::Motion(quantity) => moment.rig.meter().extremes.of(quantity),
            Judge::Cycle(_, judge) => judge(moment),
        }
    }
}

/// Place of a property in [`PROPERTIES`].
pub fn place(name: &str) -> usize {
    PROPERTIES
        .iter()
        .position(|property| property.name == name)
        .unwrap_or_else(|| panic!("no property {name}"))
}

/// The table of docs/safety.md.
pub fn table() -> String {
    let row = |property: &Property| {
        let worlds: Vec<_> = property.worlds.iter().map(name).collect();
        let frozen = if property.with_frozen_sensors { ", frozen sensors" } else { "" };
        format!("| {} | {} | {}{frozen} |\n", property.name, property.claim, worlds.join(", "))
    };
    "| property | under control | worlds |\n| --- | --- | --- |\n".to_owned()
        + &PROPERTIES.iter().map(row).collect::<String>()
}
