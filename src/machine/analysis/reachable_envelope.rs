//! Default envelope of a machine: as large as stroke, rates and forces allow with reserve.
//!
//! The box of the pose starts at a nominal size and shrinks until all of its corners are within the stroke;
//! then the frequency of a sine through that box, which gives velocity `w a` and acceleration `w^2 a`,
//! is lowered until rates and forces have reserve at every corner of the envelope. Every
//! machine reaches the result; for one without any stroke left it is home alone, at rest. Corners are checked, not the
//! inside.

use core::f64::consts::TAU;

use super::envelope::{CORNER_COUNT, EnvelopeBounds, MotionEnvelope};
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Exact;
use hexad_core::model::inverse_geometry::{leg_lengths, leg_motion};
use hexad_core::model::machine::Machine;
use hexad_core::model::task::TaskState;

/// Half of the box before it shrinks, as the built-in motions: in position as a share of the platform's radius, in angle.
const POSITION_OVER_RADIUS: f64 = 0.2;
const ANGLE_RAD: f64 = 0.105;

/// First frequency of the sine \[Hz\]: about that of the built-in motions.
const FREQUENCY_HZ: f64 = 0.5;

/// Share of the limits of rate and force that the envelope uses.
const USABLE_SHARE: f64 = 0.8;

/// Each step shrinks by a fifth: 40 of them reach 1e-4 of the size, and a box still too large then counts as empty.
const MAX_SHRINK_STEPS: i32 = 40;

/// The default envelope of a machine.
///
/// ```
/// use hexad_machine::analysis::{envelope::CORNER_COUNT, reachable_envelope::{reachable_envelope, within_stroke}};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let envelope = reachable_envelope(&hexad_core::model::active_forces::InverseDynamics::new(&machine));
/// assert!((0..CORNER_COUNT).all(|k| within_stroke(&machine, &envelope.at(&envelope.corner(k)))));
/// ```
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

/// Bounds of the box before it shrinks, at rest.
pub fn nominal_bounds(machine: &Machine) -> EnvelopeBounds {
    let p = POSITION_OVER_RADIUS * machine.joints.radius_m;
    let half = [ANGLE_RAD, ANGLE_RAD, ANGLE_RAD, p, p, p];
    EnvelopeBounds { pose_min: half.map(|a| -a), pose_max: half, velocity: [0.0; 6], acceleration: [0.0; 6] }
}

/// Whether every leg is within its stroke at a state.
pub fn within_stroke(machine: &Machine, state: &TaskState) -> bool {
    leg_lengths(machine, &state.motion().pose).iter().all(|length| machine.actuator.contains(*length))
}

/// The largest of a family of bounds that is feasible at every corner; the one of size 0 if none is.
fn shrunk(
    machine: &Machine,
    sized: impl Fn(f64) -> EnvelopeBounds,
    is_feasible: impl Fn(&TaskState) -> bool,
) -> EnvelopeBounds {
    let is_feasible_at_all_corners = |limits: &EnvelopeBounds| {
        let envelope = MotionEnvelope::new(&machine.home, *limits);
        (0..CORNER_COUNT).all(|k| is_feasible(&envelope.at(&envelope.corner(k))))
    };
    let mut sizes = (0..MAX_SHRINK_STEPS).map(|step| sized(libm::pow(0.8, step.into())));
    sizes.find(is_feasible_at_all_corners).unwrap_or_else(|| sized(0.0))
}

/// Whether rates and forces keep their reserve.
fn has_reserve(model: &InverseDynamics, state: &TaskState) -> bool {
    let actuator = &model.machine().actuator;
    let motion = state.motion();
    let within = |values: &[f64], limit: f64| values.iter().all(|x| x.abs() <= USABLE_SHARE * limit);
    within(&leg_motion(model.machine(), &motion).rate_m_s, actuator.max_rate_m_s)
        && model
            .forces::<Exact>(&motion)
            .is_some_and(|force| within(&force, actuator.weakest_available_force_n()))
}
