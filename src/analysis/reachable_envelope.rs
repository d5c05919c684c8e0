//! The envelope of a machine about which nothing else is known: as large as it can carry with reserve.
//!
//! The box of the pose starts at a nominal size and shrinks until all of its corners are within the stroke;
//! then the frequency of a sine through that box, which gives velocity `w a` and acceleration `w^2 a`,
//! goes down until rates and forces have reserve at every corner of the envelope. Whatever the
//! machine, the result is an envelope it can reach; for one without any room it is home alone, at rest.

use core::f64::consts::TAU;

use super::envelope::{CORNER_COUNT, EnvelopeBounds, MotionEnvelope};
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Exact;
use crate::model::inverse_geometry::leg_motion;
use crate::model::machine::Machine;
use crate::model::task::TaskState;

/// Half of the box before it shrinks: in position as a share of the platform's radius, in angle \[rad\].
/// As the built-in motions.
const POSITION_OVER_RADIUS: f64 = 0.2;
const ANGLE_RAD: f64 = 0.105;

/// The sine's frequency before it goes down \[Hz\]: about that of the built-in motions.
const FREQUENCY_HZ: f64 = 0.5;

/// Share of rate and force to be used.
const USABLE_SHARE: f64 = 0.8;

/// Each step takes a fifth: 40 of them reach 1e-4, and what is still too large then is nothing.
const MAX_SHRINK_STEPS: i32 = 40;

/// The envelope of a machine.
pub fn reachable_envelope(model: &InverseDynamics) -> MotionEnvelope {
    let machine = model.machine();
    let boxed = |share: f64| {
        let nominal = nominal_bounds(machine);
        let [pose_min, pose_max] = [nominal.pose_min, nominal.pose_max].map(|ends| ends.map(|a| a * share));
        EnvelopeBounds { pose_min, pose_max, ..nominal }
    };
    let pose = shrunk(machine, boxed, |state| within_stroke(machine, state));
    let moving = |share: f64| {
        let omega = TAU * FREQUENCY_HZ * share;
        let velocity = pose.pose_max.map(|a| a * omega);
        EnvelopeBounds { velocity, acceleration: velocity.map(|v| v * omega), ..pose }
    };
    MotionEnvelope::new(&machine.home, shrunk(machine, moving, |state| has_reserve(model, state)))
}

/// The box before it shrinks, at rest.
pub fn nominal_bounds(machine: &Machine) -> EnvelopeBounds {
    let p = POSITION_OVER_RADIUS * machine.joints.radius;
    let half = [ANGLE_RAD, ANGLE_RAD, ANGLE_RAD, p, p, p];
    EnvelopeBounds { pose_min: half.map(|a| -a), pose_max: half, velocity: [0.0; 6], acceleration: [0.0; 6] }
}

/// Whether every leg is within its stroke.
pub fn within_stroke(machine: &Machine, state: &TaskState) -> bool {
    let stroke = machine.actuator.min_length..=machine.actuator.max_length;
    leg_motion(machine, &state.motion()).length.iter().all(|length| stroke.contains(length))
}

/// The largest of a family of limits that will do at every corner; the one of size 0 if none does.
fn shrunk(
    machine: &Machine,
    sized: impl Fn(f64) -> EnvelopeBounds,
    will_do: impl Fn(&TaskState) -> bool,
) -> EnvelopeBounds {
    let all_corners_will = |limits: &EnvelopeBounds| {
        let envelope = MotionEnvelope::new(&machine.home, *limits);
        (0..CORNER_COUNT).all(|k| will_do(&envelope.at(&envelope.corner(k))))
    };
    let mut sizes = (0..MAX_SHRINK_STEPS).map(|step| sized(0.8_f64.powi(step)));
    sizes.find(all_corners_will).unwrap_or_else(|| sized(0.0))
}

/// Whether rates and forces keep their reserve.
fn has_reserve(model: &InverseDynamics, state: &TaskState) -> bool {
    let actuator = &model.machine().actuator;
    let motion = state.motion();
    let within = |values: &[f64], limit: f64| values.iter().all(|x| x.abs() <= USABLE_SHARE * limit);
    within(&leg_motion(model.machine(), &motion).rate, actuator.max_rate)
        && model.forces::<Exact>(&motion).is_some_and(|force| within(&force, actuator.max_force))
}
