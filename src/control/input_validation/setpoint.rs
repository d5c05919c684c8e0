//! Validation of setpoints: limits, envelope, stroke, room to stop, and the continuation of the one before.

use super::{LastValid, check_stroke, check_time_stamp, seconds_between};
use crate::control::controller::{Cycle, Setpoint};
use crate::control::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::limits::{Limit, LimitSet, Limits};
use crate::control::parameters::Parameters;
use crate::control::quintic_offset::QuinticOffset;
use crate::control::state::State;
use crate::control::tracking_error::TrackingError;
use crate::model::inverse_geometry::leg_motion;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::Machine;
use crate::model::rigid::{Motion, Pose, Twist};

/// Tolerance of a setpoint against the continuation of the one before, as a ratio of the way between: time stamps
/// are a little early or late.
const CONTINUATION_TOLERANCE_RATIO: f64 = 0.25;

/// The constant part of that tolerance, as a ratio of the stroke: too small to do harm, and numbers are rounded.
const CONTINUATION_TOLERANCE_PER_STROKE: f64 = 1e-4;

/// The constant tolerance of the rate is that of the position divided by this time \[s\].
const RATE_TOLERANCE_TIME_S: f64 = 0.1;

/// Allowance for rounding, so that a range whose ends are equal can be satisfied \[rad\] or \[m\].
const ENVELOPE_ROUNDING: f64 = 1e-9;

/// A setpoint with the motion of the platform it describes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetpointMotion {
    /// The setpoint as received: time stamp and X, X', X''.
    pub setpoint: Setpoint,
    /// Pose, twist and acceleration of the platform at its time stamp, base axes.
    pub motion: Motion,
}

impl SetpointMotion {
    /// Evaluates the motion of a setpoint.
    pub fn new(setpoint: Setpoint) -> Self {
        Self { setpoint, motion: setpoint.task.motion() }
    }

    /// The motion at another instant, extrapolated no further than a setpoint may be.
    pub(in crate::control) fn motion_at(&self, parameters: &Parameters, instant_ns: u64) -> Motion {
        if instant_ns == self.setpoint.time_ns {
            return self.motion;
        }
        let longest = parameters.max_extrapolation_s();
        // Of the motion and not of X: rates of the angles are unbounded near gimbal lock.
        self.motion.after(seconds_between(self.setpoint.time_ns, instant_ns).max(-longest).min(longest))
    }
}

/// The last valid setpoint, whether it may be followed, and the limits it is near to.
pub(in crate::control) struct ValidatedSetpoint<'a> {
    pub valid: Option<&'a SetpointMotion>,
    /// Whether the valid setpoint is young enough.
    pub status: Result<(), Diagnostic>,
    /// Of the newest setpoint.
    pub active_limits: LimitSet,
    /// The setpoint that was followed before, if the present one is the first after a gap.
    pub before_gap: Option<SetpointMotion>,
}

/// First stage of the cycle: validates each new setpoint and keeps the last valid one.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control) struct SetpointValidator {
    last: LastValid<SetpointMotion>,
    /// Of the newest setpoint.
    active_limits: LimitSet,
    /// Cycles under control without a new valid setpoint.
    pub missed: u64,
}

impl SetpointValidator {
    /// Validates the newest setpoint, if it is new.
    pub fn validate(&mut self, cycle: &Cycle<'_>, newest: Option<&Setpoint>) -> ValidatedSetpoint<'_> {
        let new =
            newest.filter(|newest| self.last.newest.as_ref().map(|last| &last.setpoint) != Some(newest));
        let (mut is_accepted, mut before_gap) = (false, None);
        if let Some(new) = new {
            (is_accepted, before_gap) = self.accept(cycle, SetpointMotion::new(*new));
        }
        self.missed += u64::from(cycle.state.has_control() && !is_accepted);
        ValidatedSetpoint {
            valid: self.last.valid.as_ref(),
            status: self.check_age(cycle),
            active_limits: self.active_limits,
            before_gap,
        }
    }

    fn check_age(&self, cycle: &Cycle<'_>) -> Result<(), Diagnostic> {
        let Some(SetpointMotion { setpoint, .. }) = &self.last.valid else {
            return Err(self.last.rejection_or(DiagnosticCode::NoSetpoint));
        };
        let is_at_rest = setpoint.task.xd.amax() == 0.0 && setpoint.task.xdd.amax() == 0.0;
        let code = if is_at_rest { DiagnosticCode::SetpointEnded } else { DiagnosticCode::SetpointLost };
        let timeout_ns = cycle.constants.parameters.setpoint_timeout_ns;
        check_time_stamp(code, setpoint.time_ns, cycle.release_ns, timeout_ns)
            .map_err(|lost| self.last.rejection_or(lost))
    }

    /// Validates a new setpoint and records it: whether it is accepted, and the setpoint before if that was followed
    /// up to a gap. A setpoint must continue the last valid one if the platform follows that.
    fn accept(&mut self, cycle: &Cycle<'_>, new: SetpointMotion) -> (bool, Option<SetpointMotion>) {
        let (constants, now_ns) = (cycle.constants, cycle.release_ns);
        let parameters = &constants.parameters;
        let (time_ns, period_ns) = (new.setpoint.time_ns, parameters.period_ns);
        let followed = match cycle.state {
            State::Engaging | State::Active => self.last.valid.as_ref(),
            _ => None,
        };
        let window_s = self.last.plausibility_window_s(now_ns, period_ns);
        let timeout_ns = parameters.setpoint_timeout_ns;
        let code = DiagnosticCode::SetpointStampInvalid;
        let SetpointCheck { active_limits, result } =
            match check_time_stamp(code, time_ns, now_ns, timeout_ns) {
                Ok(()) => {
                    check_setpoint(constants.machine(), parameters, &constants.home, &new, followed, window_s)
                }
                result => SetpointCheck { active_limits: LimitSet::default(), result },
            };
        let is_gap =
            |before: &&SetpointMotion| time_ns.abs_diff(before.setpoint.time_ns) > period_ns + period_ns / 2;
        let before_gap = followed.filter(is_gap);
        let result =
            result.and_then(|()| before_gap.map_or(Ok(()), |before| check_resumption(cycle, before, &new)));
        let before_gap = before_gap.copied().filter(|_| result.is_ok());
        let keep_first = matches!(cycle.state, State::Engaging | State::Active);
        self.active_limits = active_limits;
        self.last.record(new, result, now_ns, keep_first);
        (result.is_ok(), before_gap)
    }
}

/// After a gap the setpoint must be within the engage tolerance of the extrapolated previous one.
// Out of line, as it is rare: the cycle stays short.
#[inline(never)]
fn check_resumption(
    cycle: &Cycle<'_>,
    before: &SetpointMotion,
    new: &SetpointMotion,
) -> Result<(), Diagnostic> {
    let (parameters, now_ns) = (&cycle.constants.parameters, cycle.release_ns);
    let continued = before.motion_at(parameters, now_ns);
    let next = new.motion_at(parameters, now_ns);
    let ratio = TrackingError::new(&continued, &next.pose, &next.twist).tolerance_ratio(parameters);
    if ratio <= 1.0 { Ok(()) } else { Err(Diagnostic::new(DiagnosticCode::SetpointJumped, ratio, 1.0)) }
}

/// Result of the checks of one setpoint.
#[derive(Clone, Copy, Debug)]
pub struct SetpointCheck {
    /// The limits that the setpoint is near to, up to the check that failed.
    pub active_limits: LimitSet,
    /// `Ok` if the setpoint passed every check, else the diagnostic of the first that failed.
    pub result: Result<(), Diagnostic>,
}

/// Checks that a setpoint keeps the limits and, if the platform follows `before`, continues it. `window_s`: longest
/// time over which a change counts as plausible.
pub fn check_setpoint(
    machine: &Machine,
    parameters: &Parameters,
    home: &KinematicState,
    now: &SetpointMotion,
    before: Option<&SetpointMotion>,
    window_s: f64,
) -> SetpointCheck {
    let mut active_limits = LimitSet::default();
    let result = check_limits(machine, parameters, home, now, &mut active_limits)
        .and_then(|()| check_continuation(machine, parameters, now, before, window_s, &mut active_limits));
    SetpointCheck { active_limits, result }
}

fn check_limits(
    machine: &Machine,
    parameters: &Parameters,
    home: &KinematicState,
    SetpointMotion { setpoint, motion }: &SetpointMotion,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    if !setpoint.task.is_finite() {
        return Err(DiagnosticCode::SetpointNotFinite.into());
    }
    check_velocity_and_acceleration(parameters, motion, active)?;
    check_envelope(parameters, setpoint, active)?;
    check_legs(machine, motion, active)?;
    check_room_to_stop(machine, parameters, home, motion, active)
}

fn check_velocity_and_acceleration(
    parameters: &Parameters,
    motion: &Motion,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let Motion { twist, acceleration, .. } = motion;
    let Limits { orientation, position, .. } = &parameters.limits;
    let velocity = (twist.angular.norm() / orientation.velocity).max(twist.linear.norm() / position.velocity);
    let acceleration = (acceleration.angular.norm() / orientation.acceleration)
        .max(acceleration.linear.norm() / position.acceleration);
    for (limit, ratio) in [(Limit::Velocity, velocity), (Limit::Acceleration, acceleration)] {
        if !active.check(limit, ratio) {
            return Err(Diagnostic::new(DiagnosticCode::SetpointTooFast, ratio, 1.0));
        }
    }
    Ok(())
}

fn check_envelope(
    parameters: &Parameters,
    setpoint: &Setpoint,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let Some(envelope) = &parameters.envelope else { return Ok(()) };
    let ranges = envelope.lowest.iter().zip(&envelope.highest);
    for (axis, (x, (low, high))) in setpoint.task.x.iter().zip(ranges).enumerate() {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let distance = (x - middle).abs();
        if !active.check(Limit::Envelope, distance / (half + ENVELOPE_ROUNDING)) {
            let bound = if *x > middle { *high } else { *low };
            return Err(Diagnostic::new(DiagnosticCode::SetpointOutOfEnvelope, *x, bound).at(axis));
        }
    }
    Ok(())
}

fn check_legs(machine: &Machine, motion: &Motion, active: &mut LimitSet) -> Result<(), Diagnostic> {
    let actuator = &machine.actuator;
    let legs = leg_motion(machine, motion);
    for (leg, rate) in legs.rate.iter().enumerate() {
        let ratio = rate.abs() / actuator.max_rate;
        if !active.check(Limit::LegRate, ratio) {
            return Err(Diagnostic::new(DiagnosticCode::SetpointTooFast, ratio, 1.0).at(leg));
        }
    }
    check_stroke(actuator, 0.0, DiagnosticCode::SetpointOutOfReach, &legs.length)
}

/// Whether the platform would come to rest within the stroke and before a singular pose if this were the last message.
fn check_room_to_stop(
    machine: &Machine,
    parameters: &Parameters,
    home: &KinematicState,
    motion: &Motion,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let actuator = &machine.actuator;
    let stop = KinematicState::new(machine, stop_pose(parameters, motion));
    let length = stop.lengths(machine);
    let middle = 0.5 * (actuator.min_length + actuator.max_length);
    let distance = length.iter().fold(0.0_f64, |largest, length| largest.max((length - middle).abs()));
    active.check(Limit::Stroke, distance / (0.5 * actuator.stroke()));
    check_stroke(actuator, 0.0, DiagnosticCode::SetpointOutOfReach, &length)?;
    let (stop, home) = (stop.sensitivity(), home.sensitivity());
    // The way to the other side of a singularity crosses it: the condition has no bound there.
    let is_across = stop.determinant * home.determinant < 0.0;
    let condition = if is_across { f64::INFINITY } else { stop.condition };
    if !active.check(Limit::Condition, condition / parameters.condition) {
        return Err(Diagnostic::new(DiagnosticCode::NearSingular, condition, parameters.condition));
    }
    Ok(())
}

/// Pose of the platform at rest if this is the last setpoint: extrapolated for the timeout, then stopped.
fn stop_pose(parameters: &Parameters, motion: &Motion) -> Pose {
    let t = parameters.max_extrapolation_s();
    let (v, a) = (motion.twist.vector(), motion.acceleration.vector());
    let last = Twist::from_vector(&(v + a * t));
    let stop = QuinticOffset::to_rest(0, &last, &motion.acceleration, &parameters.limits);
    motion.pose.displaced(&Twist::from_vector(&((v + a * (0.5 * t)) * t + stop.end())))
}

/// Whether X' and X'' are the derivatives of X, as far as two messages can show.
fn check_continuation(
    machine: &Machine,
    parameters: &Parameters,
    now: &SetpointMotion,
    before: Option<&SetpointMotion>,
    window_s: f64,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let Some(before) = before else { return Ok(()) };
    let dt = seconds_between(before.setpoint.time_ns, now.setpoint.time_ns);
    if dt <= 0.0 {
        return Err(Diagnostic::new(DiagnosticCode::SetpointStampInvalid, -dt, 0.0));
    }
    let (now, before) = (&now.motion, &before.motion);
    let tolerance = CONTINUATION_TOLERANCE_PER_STROKE * machine.actuator.stroke();
    let time = dt.min(window_s);
    let moved = before.pose.displacement_to(&now.pose);
    let rates = |motion: &Motion| [motion.twist.angular, motion.twist.linear];
    let accelerations = |motion: &Motion| [motion.acceleration.angular, motion.acceleration.linear];
    let (v, v_before) = (rates(now), rates(before));
    let (a, a_before) = (accelerations(now), accelerations(before));
    let limits = [&parameters.limits.orientation, &parameters.limits.position];
    let tolerances = [tolerance / machine.joints.radius, tolerance];
    let each =
        [moved.angular, moved.linear].into_iter().zip(v.iter().zip(&v_before)).zip(a.iter().zip(&a_before));
    for (((moved, (v, v_before)), (a, a_before)), (limit, tolerance)) in
        each.zip(limits.into_iter().zip(tolerances))
    {
        let jerk = limit.jerk * time;
        let velocity = v.norm().max(v_before.norm());
        let acceleration = a.norm().max(a_before.norm());
        let x = (moved - (v + v_before) * (0.5 * dt)).norm()
            / (CONTINUATION_TOLERANCE_RATIO * (velocity * time) + jerk * time * time / 12.0 + tolerance);
        let v = (v - v_before - (a + a_before) * (0.5 * dt)).norm()
            / (CONTINUATION_TOLERANCE_RATIO * acceleration * time
                + 0.25 * jerk * time
                + tolerance / RATE_TOLERANCE_TIME_S);
        if x > 1.0 || v > 1.0 {
            return Err(Diagnostic::new(DiagnosticCode::SetpointJumped, x.max(v), 1.0));
        }
        // The rate of X'' is taken over a period at least: messages that come in pairs are no jerk.
        let interval = time.max(parameters.period_s());
        let ratio = (a - a_before).norm() / (limit.jerk * interval);
        if !active.check(Limit::Jerk, ratio) {
            return Err(Diagnostic::new(DiagnosticCode::SetpointTooFast, ratio, 1.0));
        }
    }
    Ok(())
}
