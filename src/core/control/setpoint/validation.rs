//! Validation of setpoints.
//!
//! The reference keeps its limits for every setpoint, without these checks. They find a trajectory that the
//! machine cannot follow:
//!
//! | check | applies to |
//! | --- | --- |
//! | numbers, time stamp, kind | every setpoint |
//! | velocity, acceleration, leg rates | a motion |
//! | stroke, envelope | a motion or a target |
//! | deviation within the engage tolerance | a motion that is followed |
//!
//! The deviation is measured from the reference, and while engaging from the continuation of the previous
//! setpoint.
//!
//! Numbers, time stamp and kind reject a setpoint. The other checks reject it under `on_violation = "stop"`.
//! Under "limit" they decide whether the reference needs its walls: a setpoint that "stop" accepts is followed
//! without them, and so with the same reference.

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::cycle::Cycle;
use crate::control::parameters::{Parameters, ViolationPolicy};
use crate::control::reference::ReferenceGenerator;
use crate::control::sensing::last_input::{LastInput, check_stroke, check_time_stamp};
use crate::control::setpoint::motion::SetpointMotion;
use crate::control::setpoint::pose_samples::PoseSamples;
use crate::control::setpoint::target::Target;
use crate::control::setpoint::validated::ValidatedSetpoint;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::errors::PoseError;
use crate::control::signals::inputs::{Input, Setpoint, SetpointKind};
use crate::control::signals::limits::{Limit, LimitSet, Limits, largest_ratio_or_nan};
use crate::control::signals::state::{AfterStop, State};
use crate::control::signals::time::seconds_between;
use crate::model::inverse_geometry::leg_lengths_and_rates;
use crate::model::machine::Machine;
use crate::model::rigid::Motion;

/// Allowance for rounding, so that a range whose ends are equal can be satisfied \[rad\] or \[m\].
const ENVELOPE_ROUNDING: f64 = 1e-9;

/// Deviation from the continuation of the previous setpoint that counts as a jump, as a ratio of the engage
/// tolerance.
const JUMP_RATIO: f64 = 0.5;

/// First stage of the cycle: validates each new setpoint and keeps the last valid one.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct SetpointValidator {
    last: LastInput<Setpoint, SetpointMotion>,
    samples: PoseSamples,
    /// Limits that the newest setpoint is near, under "stop".
    active_limits: LimitSet,
    /// Whether the valid setpoint keeps the limits, as "stop" demands.
    keeps_limits: bool,
    /// Cycles under control without a new valid setpoint.
    pub cycles_without_valid: u64,
}

impl SetpointValidator {
    /// Validates the newest setpoint, if it is new.
    pub fn validate(
        &mut self,
        cycle: &Cycle<'_>,
        input: &Input,
        holds_pose: bool,
        reference: &ReferenceGenerator,
    ) -> ValidatedSetpoint<'_> {
        let new = input.setpoint.as_ref().filter(|newest| self.last.is_new(newest));
        let is_accepted = new.is_some_and(|new| {
            let parameters = &cycle.constants.parameters;
            let mut new = SetpointMotion::new(*new);
            new.set_jerk_from_previous(parameters, self.last.valid.as_ref());
            self.accept(cycle, &new, reference)
        });
        self.cycles_without_valid += u64::from(cycle.state.has_control() && !is_accepted);
        let valid = self.last.valid.as_ref();
        let target = valid.map(|valid| Target::of_setpoint(valid, &self.samples));
        ValidatedSetpoint {
            valid,
            target,
            follow_check: self.check_age(cycle).and_then(|()| match &target {
                Some(target) if holds_pose => check_return(cycle.constants, target, reference),
                _ => Ok(()),
            }),
            active_limits: self.active_limits,
            keeps_limits: self.keeps_limits,
        }
    }

    /// Forgets every setpoint. The newest is then validated again.
    pub fn forget(&mut self) {
        *self = Self { cycles_without_valid: self.cycles_without_valid, ..Self::default() };
    }

    /// Whether the valid setpoint is recent enough to be followed. A target has no end and stays valid while
    /// it is followed.
    fn check_age(&self, cycle: &Cycle<'_>) -> Result<(), Diagnostic> {
        let Some(SetpointMotion { setpoint, motion, .. }) = &self.last.valid else {
            return Err(self.last.rejection_or(DiagnosticCode::NoSetpoint));
        };
        let is_followed = cycle.state.follows();
        if is_followed && setpoint.kind == SetpointKind::Target {
            return Ok(());
        }
        let Parameters { on_violation, setpoint_timeout_ns, after_loss, lost_hold_ns, .. } =
            &cycle.constants.parameters;
        let is_at_rest = motion.twist.vector().amax() == 0.0 && motion.acceleration.vector().amax() == 0.0;
        let (release_ns, timeout_ns) = (cycle.release_ns, *setpoint_timeout_ns);
        if *on_violation == ViolationPolicy::Limit && is_followed {
            if *after_loss != AfterStop::Fault {
                let (code, longest_ns) =
                    (DiagnosticCode::WithoutSetpoints, timeout_ns.saturating_add(*lost_hold_ns));
                check_time_stamp(code, setpoint.time_ns, release_ns, longest_ns)?;
            }
            return check_time_stamp(DiagnosticCode::HoldingPose, setpoint.time_ns, release_ns, timeout_ns);
        }
        let code = if is_at_rest { DiagnosticCode::SetpointEnded } else { DiagnosticCode::SetpointLost };
        check_time_stamp(code, setpoint.time_ns, release_ns, timeout_ns)
            .map_err(|lost| self.last.rejection_or(lost))
    }

    /// Validates a new setpoint and records it. True if it is accepted.
    fn accept(&mut self, cycle: &Cycle<'_>, new: &SetpointMotion, reference: &ReferenceGenerator) -> bool {
        let (constants, now_ns) = (cycle.constants, cycle.release_ns);
        let parameters = &constants.parameters;
        let followed = self.last.valid.as_ref().filter(|_| cycle.state.follows());
        let timeout_ns = parameters.setpoint_timeout_ns;
        let stops = parameters.on_violation == ViolationPolicy::Stop;
        let mut near_limits = LimitSet::default();
        let mut within_limits = Ok(());
        let mut check = || {
            let (code, time_ns) = (DiagnosticCode::SetpointStampInvalid, new.setpoint.time_ns);
            check_time_stamp(code, time_ns, now_ns, timeout_ns)?;
            check_kind(parameters, &new.setpoint)?;
            check_order(new, followed)?;
            within_limits = check_setpoint(constants.machine(), parameters, new, &mut near_limits)
                .and_then(|()| check_continuation(cycle, new, followed, reference));
            if stops { within_limits } else { Ok(()) }
        };
        let result = check();
        self.active_limits = if stops { near_limits } else { LimitSet::default() };
        if result.is_ok() {
            self.keeps_limits = within_limits.is_ok();
            if new.setpoint.kind == SetpointKind::Pose {
                self.samples.push(now_ns, new.setpoint.time_ns, &new.motion.pose);
                self.keeps_limits &= do_samples_keep_limits(cycle, new, &self.samples, reference);
            }
        }
        self.last.record(&new.setpoint, result.map(|()| new), now_ns, cycle.state.follows());
        result.is_ok()
    }
}

/// Whether a platform that holds its pose after a loss may follow again: a target near the reference, or any, as configured.
#[inline(never)]
fn check_return(
    constants: &Constants,
    target: &Target<'_>,
    reference: &ReferenceGenerator,
) -> Result<(), Diagnostic> {
    let parameters = &constants.parameters;
    if !parameters.holds_on_return {
        return Ok(());
    }
    let offset = reference.offset_to(constants, target);
    let ratio = offset.map_or(f64::INFINITY, |offset| parameters.engage_tolerance_ratio(&offset));
    if ratio <= 1.0 { Ok(()) } else { Err(Diagnostic::new(DiagnosticCode::SetpointTooFar, ratio, 1.0)) }
}

/// Whether the motion through the samples keeps the limits, and while it is followed the reference keeps up with it.
#[inline(never)]
fn do_samples_keep_limits(
    cycle: &Cycle<'_>,
    new: &SetpointMotion,
    samples: &PoseSamples,
    reference: &ReferenceGenerator,
) -> bool {
    let (constants, parameters) = (cycle.constants, &cycle.constants.parameters);
    let keeps_up = || {
        let offset = reference.offset_to(constants, &Target::Samples(samples));
        offset.is_some_and(|offset| parameters.engage_tolerance_ratio(&offset) <= 1.0)
    };
    let Some(motion) = samples.target(cycle.release_ns) else { return false };
    let mut sampled = *new;
    sampled.motion = motion;
    check_setpoint(constants.machine(), parameters, &sampled, &mut LimitSet::default()).is_ok()
        && (cycle.state != State::Active || keeps_up())
}

/// Whether the numbers are finite and the policy allows the kind.
#[inline(never)]
fn check_kind(parameters: &Parameters, setpoint: &Setpoint) -> Result<(), Diagnostic> {
    if !setpoint.task.is_finite() {
        return Err(DiagnosticCode::SetpointNotFinite.into());
    }
    // Out of line, like its table of kinds: the proof on the machine code of `step` does not cover such
    // tables.
    let is_pose_allowed = parameters.on_violation == ViolationPolicy::Limit;
    let is_allowed = setpoint.kind == SetpointKind::Motion
        || setpoint.kind == SetpointKind::Target
        || setpoint.kind == SetpointKind::Pose && is_pose_allowed;
    if is_allowed { Ok(()) } else { Err(DiagnosticCode::SetpointKindInvalid.into()) }
}

/// Whether the time stamp is later than the previous setpoint's.
fn check_order(new: &SetpointMotion, before: Option<&SetpointMotion>) -> Result<(), Diagnostic> {
    let dt = before.map_or(1.0, |before| seconds_between(before.setpoint.time_ns, new.setpoint.time_ns));
    if dt > 0.0 { Ok(()) } else { Err(Diagnostic::new(DiagnosticCode::SetpointStampInvalid, -dt, 0.0)) }
}

/// Whether a motion that is followed continues: from the reference, or while engaging from the previous
/// setpoint.
fn check_continuation(
    cycle: &Cycle<'_>,
    new: &SetpointMotion,
    followed: Option<&SetpointMotion>,
    reference: &ReferenceGenerator,
) -> Result<(), Diagnostic> {
    let (Some(before), SetpointKind::Motion) = (followed, new.setpoint.kind) else { return Ok(()) };
    let parameters = &cycle.constants.parameters;
    if cycle.state == State::Active {
        return check_deviation(parameters, reference, before, new);
    }
    let ratio = jump_ratio(parameters, before, new);
    if ratio <= 1.0 { Ok(()) } else { Err(Diagnostic::new(DiagnosticCode::SetpointJumped, ratio, 1.0)) }
}

/// Whether the reference is within the engage tolerance of a setpoint. If not, either the setpoint has jumped
/// from the previous one, or the limits kept the reference from following.
pub fn check_deviation(
    parameters: &Parameters,
    reference: &ReferenceGenerator,
    before: &SetpointMotion,
    setpoint: &SetpointMotion,
) -> Result<(), Diagnostic> {
    let ratio = parameters.engage_tolerance_ratio(&reference.offset_to_setpoint(parameters, setpoint));
    if ratio <= 1.0 {
        return Ok(());
    }
    let has_jumped = jump_ratio(parameters, before, setpoint) > JUMP_RATIO;
    let code = if has_jumped { DiagnosticCode::SetpointJumped } else { DiagnosticCode::SetpointBeyondLimits };
    Err(Diagnostic::new(code, ratio, 1.0))
}

/// Deviation of a setpoint from the continuation of the previous one, as a ratio of the engage tolerance.
fn jump_ratio(parameters: &Parameters, before: &SetpointMotion, setpoint: &SetpointMotion) -> f64 {
    let continued = before.motion_at(parameters, setpoint.setpoint.time_ns);
    parameters.engage_tolerance_ratio(&PoseError::new(&setpoint.motion, &continued.pose, &continued.twist))
}

/// Whether a setpoint keeps the limits at its instant. Adds the limits that it is near, up to the check that
/// fails.
pub fn check_setpoint(
    machine: &Machine,
    parameters: &Parameters,
    SetpointMotion { setpoint, motion, .. }: &SetpointMotion,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    check_velocity_and_acceleration(parameters, motion, active)?;
    check_envelope(parameters, setpoint, active)?;
    check_legs(machine, parameters, motion, active)
}

fn check_velocity_and_acceleration(
    parameters: &Parameters,
    motion: &Motion,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let Motion { twist, acceleration, .. } = motion;
    let Limits { orientation, position, .. } = &parameters.limits;
    let velocity = largest_ratio_or_nan([
        twist.angular.norm() / orientation.velocity,
        twist.linear.norm() / position.velocity,
    ]);
    let acceleration = largest_ratio_or_nan([
        acceleration.angular.norm() / orientation.acceleration,
        acceleration.linear.norm() / position.acceleration,
    ]);
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

fn check_legs(
    machine: &Machine,
    parameters: &Parameters,
    motion: &Motion,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let actuator = &machine.actuator;
    let (lengths, rates) = leg_lengths_and_rates(machine, &motion.pose, &motion.twist);
    for (leg, rate) in rates.iter().enumerate() {
        let ratio = rate.abs() / actuator.max_rate_m_s;
        if !active.check(Limit::LegRate, ratio) {
            return Err(Diagnostic::new(DiagnosticCode::SetpointTooFast, ratio, 1.0).at(leg));
        }
    }
    check_stroke(actuator, -parameters.stroke_margin_m, DiagnosticCode::SetpointOutOfReach, &lengths)
}
