//! The sections that say how a machine is run: `[realtime]`, `[control]`, `[timeouts]`, `[plant]`,
//! `[envelope]`.
//!
//! Every key has a default that works at the configured rate: a slow loop gets smaller gains and longer
//! timeouts. What is given is checked against the limits that follow from the rate.

extern crate std;

use std::{format, prelude::rust_2024::*};

pub use self::plant::Plant;
pub use self::realtime::{Realtime, ReleaseKey, Scheduler};
use super::bound::Bound;
use super::machine::rounded;
use super::reader::Reader;
use crate::control::gains::{MIN_GAIN_MARGIN, gain_margin, max_bandwidth_hz};
use crate::model::ladder::Rung;
use crate::model::machine::Machine;
use crate::scene::envelope::Limits;

mod plant;
mod realtime;

/// Default of the bandwidths where the rate carries it \[Hz\]: stiff enough for micrometres, soft enough for
/// a structure that is not quite rigid.
const BANDWIDTH_HZ: f64 = 10.0;
/// Defaults of the timeouts are no shorter than this many periods: one message late is not a peer lost.
const LEAST_DEFAULT_PERIODS: f64 = 4.0;
/// Longest a peer may be silent \[ms\]. After a second, nobody knows where the platform is.
const LONGEST_TIMEOUT_MS: f64 = 1000.0;
/// Damping ratios that a control engineer would write down; beyond, it is a slip.
const DAMPING_RATIO: Bound = Bound::Within(0.1, 10.0);
/// Engaging further away than this is a motion, and needs a trajectory \[m\], \[rad\].
const FURTHEST_ENGAGE_M: f64 = 0.1;
const FURTHEST_ENGAGE_RAD: f64 = 0.2;
/// Following further away than this is not following \[m\], \[rad\].
const FURTHEST_FOLLOWING_M: f64 = 1.0;
const FURTHEST_FOLLOWING_RAD: f64 = 1.0;
/// Strongest brake \[m/s^2\]: a hundred times gravity is an impact.
const STRONGEST_BRAKE_M_S2: f64 = 1000.0;
/// Largest angle of an envelope \[rad\], just over half a turn: beyond, it is a slip of the unit.
const HALF_TURN: f64 = 3.2;

/// How a machine is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Deployment {
    /// The cycle and its threads.
    pub realtime: Realtime,
    /// The control law.
    pub control: Control,
    /// Ages of messages.
    pub timeouts: Timeouts,
    /// The simulated hardware.
    pub plant: Plant,
    /// What the platform will be asked to do; `None` if nobody has said.
    pub envelope: Option<Limits>,
}

/// `[control]`: the law's error dynamics, and how near the set point must be to engage.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// Natural frequency of the position error.
    pub position_bandwidth_hz: f64,
    /// Damping ratio of the position error.
    pub position_damping_ratio: f64,
    /// Natural frequency of the orientation error.
    pub orientation_bandwidth_hz: f64,
    /// Damping ratio of the orientation error.
    pub orientation_damping_ratio: f64,
    /// Furthest the set point may be from the platform to engage.
    pub engage_position_m: f64,
    /// The same for the angle between them.
    pub engage_orientation_rad: f64,
    /// Furthest the platform may be from the set point while it is controlled.
    pub following_position_m: f64,
    /// The same for the angle between them.
    pub following_orientation_rad: f64,
    /// Which terms of the dynamics are evaluated.
    pub fidelity: Fidelity,
    /// Largest error [`Fidelity::Auto`] may make, as a share of the peak force of the envelope.
    pub fidelity_tolerance: f64,
}

/// `control.fidelity`: which terms of the dynamics are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// As many as the envelope needs.
    Auto,
    /// Those of one rung, which has inertia.
    Fixed(Rung),
}

/// `[timeouts]`: how old the newest message may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeouts {
    /// Of the set point.
    pub setpoint_s: f64,
    /// Of the measured lengths and rates.
    pub measured_s: f64,
}

/// Reads and checks the five sections. Where a number was refused it is NaN.
pub(super) fn read(root: &mut Reader, machine: &Machine) -> Deployment {
    let realtime = realtime::read(root.section("realtime"));
    let rate_hz = realtime.rate_hz;
    Deployment {
        realtime,
        control: control(root.section("control"), rate_hz),
        timeouts: timeouts(root.section("timeouts"), rate_hz),
        plant: plant::read(root.section("plant"), rate_hz, machine),
        envelope: envelope(root.section("envelope")),
    }
}

fn control(mut section: Reader, rate_hz: f64) -> Control {
    let [position_bandwidth_hz, position_damping_ratio] =
        gains(&mut section, ["position_bandwidth_hz", "position_damping_ratio"], rate_hz);
    let [orientation_bandwidth_hz, orientation_damping_ratio] =
        gains(&mut section, ["orientation_bandwidth_hz", "orientation_damping_ratio"], rate_hz);
    let control = Control {
        position_bandwidth_hz,
        position_damping_ratio,
        orientation_bandwidth_hz,
        orientation_damping_ratio,
        engage_position_m: section.number_or("engage_position_m", 0.002, Bound::UpTo(FURTHEST_ENGAGE_M)),
        engage_orientation_rad: section.number_or(
            "engage_orientation_rad",
            0.005,
            Bound::UpTo(FURTHEST_ENGAGE_RAD),
        ),
        following_position_m: section.number_or(
            "following_position_m",
            0.02,
            Bound::UpTo(FURTHEST_FOLLOWING_M),
        ),
        following_orientation_rad: section.number_or(
            "following_orientation_rad",
            0.05,
            Bound::UpTo(FURTHEST_FOLLOWING_RAD),
        ),
        fidelity: fidelity(&mut section),
        fidelity_tolerance: section.number_or("fidelity_tolerance", 0.001, Bound::UpTo(1.0)),
    };
    section.finish();
    control
}

fn fidelity(section: &mut Reader) -> Fidelity {
    let rungs = Rung::ALL.into_iter().rev().filter(|rung| rung.has_inertia());
    let options = rungs.map(|rung| (rung.name(), Fidelity::Fixed(rung))).chain([("auto", Fidelity::Auto)]);
    section.choice_or("fidelity", Fidelity::Fixed(Rung::Exact), &options.collect::<Vec<_>>())
}

/// Bandwidth and damping ratio of one loop; refused beyond what a loop of that rate can carry.
fn gains(section: &mut Reader, [bandwidth_key, damping_key]: [&'static str; 2], rate_hz: f64) -> [f64; 2] {
    let damping_ratio = section.number_or(damping_key, 1.0, DAMPING_RATIO);
    let period_s = 1.0 / rate_hz;
    // Rounded down, so that the number in the message is one that is accepted.
    let largest = (max_bandwidth_hz(damping_ratio, period_s) * 1e3).floor() / 1e3;
    let bandwidth_hz = section.number_or(bandwidth_key, BANDWIDTH_HZ.min(largest), Bound::Positive);
    let all_read = [bandwidth_hz, damping_ratio, period_s].iter().all(|x| x.is_finite());
    if all_read && gain_margin(bandwidth_hz, damping_ratio, period_s) < MIN_GAIN_MARGIN {
        let bound = format!(
            "must be at most {largest} at realtime.rate_hz = {rate_hz} and {damping_key} = {damping_ratio} \
             (gain margin of {MIN_GAIN_MARGIN})"
        );
        section.refuse(bandwidth_key, bound);
    }
    [bandwidth_hz, damping_ratio]
}

fn timeouts(mut section: Reader, rate_hz: f64) -> Timeouts {
    let timeouts = Timeouts {
        setpoint_s: timeout_s(&mut section, "setpoint_ms", 50.0, rate_hz),
        measured_s: timeout_s(&mut section, "measured_ms", 20.0, rate_hz),
    };
    section.finish();
    timeouts
}

/// All four keys, or none.
fn envelope(mut section: Reader) -> Option<Limits> {
    let pose = |angle: Bound, position: Bound| [angle, angle, angle, position, position, position];
    let keys = [
        ("pose_min", pose(Bound::Within(-HALF_TURN, 0.0), Bound::NotPositive)),
        ("pose_max", pose(Bound::Within(0.0, HALF_TURN), Bound::NotNegative)),
        ("velocity", [Bound::NotNegative; 6]),
        ("acceleration", [Bound::NotNegative; 6]),
    ];
    let found = keys.map(|(key, bounds)| section.vector_within(key, &bounds));
    for ((key, _), value) in keys.iter().zip(&found) {
        if value.is_none() && found.iter().any(Option::is_some) {
            section.refuse(key, "missing, must be given with the other keys of the section");
        }
    }
    section.finish();
    let [Some(pose_min), Some(pose_max), Some(velocity), Some(acceleration)] = found else { return None };
    Some(Limits { pose_min, pose_max, velocity, acceleration })
}

/// A peer that sends once a cycle is silent for one period: a timeout must be longer.
fn timeout_s(section: &mut Reader, key: &'static str, default_ms: f64, rate_hz: f64) -> f64 {
    let period_ms = 1e3 / rate_hz;
    let default_ms = default_ms.max(LEAST_DEFAULT_PERIODS * period_ms);
    let timeout_ms = section.number_or(key, default_ms, Bound::UpTo(LONGEST_TIMEOUT_MS));
    if timeout_ms <= period_ms {
        let bound = format!(
            "must be greater than {} (one period of realtime.rate_hz = {rate_hz})",
            rounded(period_ms)
        );
        section.refuse(key, bound);
    }
    timeout_ms / 1e3
}
