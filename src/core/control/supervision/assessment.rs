//! Assessment of a cycle: whether the platform is located, may be engaged, and can follow its reference
//! further.

use crate::control::cycle::Cycle;
use crate::control::law::feedback_limiter::FeedbackLimiter;
use crate::control::parameters::{Parameters, ViolationPolicy};
use crate::control::reference::ReferenceGenerator;
use crate::control::sensing::localization::Localization;
use crate::control::setpoint::target::Target;
use crate::control::setpoint::validated::ValidatedSetpoint;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::errors::PoseError;
use crate::control::signals::inputs::{Input, Publishers, SetpointKind};
use crate::control::signals::limits::{Limit, LimitSet, largest_ratio_or_nan};
use crate::control::signals::state::State;
use crate::control::supervision::supervisor::Findings;

/// Deviation of the reference from its target at which the target counts as reached, as a ratio of the engage
/// tolerance: near enough to a setpoint in motion, and at home almost at rest.
const REACHED_RATIO: f64 = 0.05;
const AT_HOME_RATIO: f64 = 0.005;
/// Time within the engage tolerance after which a target counts as reached, under "limit" also if it was left again. A source
/// whose motion needs all of a limit leaves nothing for the rest of the way.
const NEAR_TIME_NS: u64 = 1_000_000_000;

/// Inputs of an assessment, besides the memory of the stages.
pub(in crate::control) struct Evidence<'a> {
    pub input: &'a Input,
    pub setpoint: &'a ValidatedSetpoint<'a>,
    /// Whether the pose is known.
    pub localization: Result<(), Diagnostic>,
    pub error: Option<&'a PoseError>,
    /// Without control: whether the reference was placed where control would begin, with a verified stop.
    pub start: Result<(), Diagnostic>,
    /// Results of the checks of drives and external pose.
    pub drive_and_pose_checks: &'a [Result<(), Diagnostic>; 2],
    /// Whether the drives are ready, or the driver does not report it.
    pub is_ready: bool,
    pub feedback: &'a FeedbackLimiter,
    /// Disagreement of the last measurement with its prediction, or a frozen sensor.
    pub sensor_or_drive_fault: Option<&'a Diagnostic>,
    /// Change of the payload or the surroundings, or an oscillation of the platform.
    pub disturbance_diagnostic: Option<&'a Diagnostic>,
    /// Whether a length repeats itself: its sensor may be frozen.
    pub may_be_frozen: bool,
}

// Out of line, like `ValidatedSetpoint::target_in`: the proof on the machine code of `step` covers no jump
// tables.
/// Findings that decide the next state. Adds the limits that the platform is near to `active_limits`, and updates the
/// instant at which the reference of an engaging platform came within the engage tolerance of its target.
#[inline(never)]
pub(in crate::control) fn assess(
    cycle: &Cycle<'_>,
    evidence: &Evidence<'_>,
    localization: &Localization,
    reference: &ReferenceGenerator,
    active_limits: &mut LimitSet,
    near_since_ns: &mut Option<u64>,
) -> Findings {
    let Evidence { setpoint, localization: located, is_ready, .. } = evidence;
    let conditioned = localization.check_condition(cycle.constants.parameters.max_condition, active_limits);
    let tracking = match cycle.state.has_control() {
        true => check_tracking(cycle, evidence, &conditioned, active_limits),
        false => conditioned,
    };
    let start = match cycle.state.has_control() || located.is_err() {
        true => Ok(()),
        false => check_start(evidence),
    };
    // Not needed while the setpoint is followed.
    let engagement = match cycle.state {
        State::Engaging | State::Active => Ok(()),
        _ => check_engagement(cycle, evidence, &conditioned, &start),
    };
    let is_waiting = cycle.state == State::Engaging && !is_ready;
    if is_waiting {
        *near_since_ns = None;
    }
    let has_ended = !is_waiting && has_ended(cycle, setpoint, reference, near_since_ns);
    let sensor_may_be_frozen = evidence.may_be_frozen;
    Findings { localization: *located, start, engagement, tracking, sensor_may_be_frozen, has_ended }
}

// The checks read each result in place, because copying many results without an error takes time.
/// Whether the reference can be followed further.
fn check_tracking(
    cycle: &Cycle<'_>,
    evidence: &Evidence<'_>,
    conditioned: &Result<(), Diagnostic>,
    active_limits: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let Evidence { input, setpoint, error, feedback, .. } = evidence;
    check_drives_and_external_pose(evidence)?;
    if let Some(diagnostic) = evidence.sensor_or_drive_fault {
        return Err(*diagnostic);
    }
    check_following_error(&cycle.constants.parameters, *error, active_limits)?;
    feedback.check_saturation_time()?;
    if let Some(diagnostic) = evidence.disturbance_diagnostic {
        return Err(*diagnostic);
    }
    check_deadline(input)?;
    if let State::Engaging | State::Active = cycle.state {
        setpoint.follow_check?;
    }
    *conditioned
}

/// Whether control may begin on the setpoint.
fn check_engagement(
    cycle: &Cycle<'_>,
    evidence: &Evidence<'_>,
    conditioned: &Result<(), Diagnostic>,
    start: &Result<(), Diagnostic>,
) -> Result<(), Diagnostic> {
    let Evidence { input, setpoint, error, .. } = evidence;
    check_no_second_publisher(DiagnosticCode::TwoMeasuredSources, input.measured_publishers)?;
    check_no_second_publisher(DiagnosticCode::TwoSetpointSources, input.setpoint_publishers)?;
    check_no_other_pose(input)?;
    check_drives_and_external_pose(evidence)?;
    (*conditioned)?;
    setpoint.follow_check?;
    check_engage_tolerance(&cycle.constants.parameters, setpoint, *error)?;
    *start
}

fn check_drives_and_external_pose(evidence: &Evidence<'_>) -> Result<(), Diagnostic> {
    let [drives, external_pose] = evidence.drive_and_pose_checks;
    (*drives)?;
    *external_pose
}

/// Whether the motion of the present state has ended.
#[inline(never)]
fn has_ended(
    cycle: &Cycle<'_>,
    setpoint: &ValidatedSetpoint<'_>,
    reference: &ReferenceGenerator,
    near_since_ns: &mut Option<u64>,
) -> bool {
    let parameters = &cycle.constants.parameters;
    let ratio = |target: &Target<'_>| {
        let deviation = reference.offset_to(cycle.constants, target);
        deviation.map_or(f64::INFINITY, |deviation| parameters.engage_tolerance_ratio(&deviation))
    };
    if let State::Engaging = cycle.state
        && setpoint.follow_check.is_ok()
        && let Some(target) = &setpoint.target
    {
        return update_arrival(ratio(target), parameters.on_violation, cycle.release_ns, near_since_ns);
    }
    *near_since_ns = None;
    match cycle.state {
        State::Stopping => reference.is_at_rest(),
        State::Parking => {
            let home = Target::Pose { pose: cycle.constants.home.pose(), speed_share: 1.0 };
            ratio(&home) <= AT_HOME_RATIO
        }
        State::Off | State::Standby | State::Engaging | State::Active | State::Fault => false,
    }
}

/// Whether an engaging platform is on its target, or has been near it for long enough. `ratio` is the deviation of the
/// reference from the target over the engage tolerance.
pub(in crate::control) fn update_arrival(
    ratio: f64,
    policy: ViolationPolicy,
    now_ns: u64,
    near_since_ns: &mut Option<u64>,
) -> bool {
    let may_be_far = policy == ViolationPolicy::Limit && near_since_ns.is_some();
    *near_since_ns = near_since_ns.or(Some(now_ns)).filter(|_| ratio <= 1.0 || may_be_far);
    let is_long = near_since_ns.is_some_and(|since_ns| now_ns.saturating_sub(since_ns) >= NEAR_TIME_NS);
    ratio <= REACHED_RATIO || is_long
}

/// Whether the platform is near the setpoint in pose and velocity. Otherwise closing the loop would itself
/// move the platform. A target may be anywhere, and a setpoint where `setpoint.approach` permits it.
fn check_engage_tolerance(
    parameters: &Parameters,
    setpoint: &ValidatedSetpoint<'_>,
    error: Option<&PoseError>,
) -> Result<(), Diagnostic> {
    let Some(error) = error else { return Err(DiagnosticCode::NoSetpoint.into()) };
    let is_target = setpoint.valid.is_some_and(|valid| valid.setpoint.kind == SetpointKind::Target);
    let ratio = parameters.engage_tolerance_ratio(error);
    if ratio <= 1.0 || is_target || parameters.approach {
        return Ok(());
    }
    Err(Diagnostic::new(DiagnosticCode::SetpointTooFar, ratio, 1.0))
}

/// Whether an input has no second publisher. Control does not begin with two, because it is unknown which one
/// is right.
fn check_no_second_publisher(code: DiagnosticCode, publishers: Publishers) -> Result<(), Diagnostic> {
    let Publishers { used_pid, ignored_pid_or_0 } = publishers;
    if ignored_pid_or_0 == 0 {
        Ok(())
    } else {
        Err(Diagnostic::new(code, used_pid.into(), ignored_pid_or_0.into()))
    }
}

/// Whether the platform can be in no other pose than the one that was found.
fn check_no_other_pose(input: &Input) -> Result<(), Diagnostic> {
    match input.other_poses {
        0 => Ok(()),
        Input::SEARCHING => Err(DiagnosticCode::FindingPose.into()),
        others => Err(Diagnostic::new(DiagnosticCode::OtherPoses, others.into(), 0.0)),
    }
}

/// Whether the motion without force is known and a stop from it was verified.
fn check_start(evidence: &Evidence<'_>) -> Result<(), Diagnostic> {
    check_no_second_publisher(DiagnosticCode::TwoMeasuredSources, evidence.input.measured_publishers)?;
    check_no_other_pose(evidence.input)?;
    check_drives_and_external_pose(evidence)?;
    evidence.start
}

fn check_following_error(
    parameters: &Parameters,
    error: Option<&PoseError>,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let Some(PoseError { pose, twist }) = error else { return Ok(()) };
    let Parameters { following_position_m, following_orientation_rad, .. } = parameters;
    let Parameters { following_velocity_m_s, following_angular_velocity_rad_s, .. } = parameters;
    let ratio = largest_ratio_or_nan([
        pose.linear.norm() / following_position_m,
        pose.angular.norm() / following_orientation_rad,
    ]);
    if !active.check(Limit::Following, ratio) {
        return Err(Diagnostic::new(DiagnosticCode::FollowingError, ratio, 1.0));
    }
    let ratio = largest_ratio_or_nan([
        twist.linear.norm() / following_velocity_m_s,
        twist.angular.norm() / following_angular_velocity_rad_s,
    ]);
    if active.check(Limit::Following, ratio) {
        return Ok(());
    }
    Err(Diagnostic::new(DiagnosticCode::VelocityError, ratio, 1.0))
}

fn check_deadline(input: &Input) -> Result<(), Diagnostic> {
    if input.had_faulty_overrun { Err(DiagnosticCode::DeadlineMissed.into()) } else { Ok(()) }
}
