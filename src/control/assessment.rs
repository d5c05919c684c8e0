//! Assessment of a cycle: whether the platform is located, may be engaged, and can follow its reference further.

use super::controller::{Cycle, Input};
use super::diagnostic::{Diagnostic, DiagnosticCode};
use super::input_validation::ValidatedSetpoint;
use super::limits::{Limit, LimitSet};
use super::localization::Localization;
use super::parameters::Parameters;
use super::reference::ReferenceGenerator;
use super::state::State;
use super::supervisor::Findings;
use super::tracking_error::{ErrorSample, TrackingError};

/// The findings that decide the next state, and the limits that the platform is near to.
pub(super) fn assess(
    cycle: &Cycle<'_>,
    input: &Input,
    setpoint: &ValidatedSetpoint<'_>,
    platform: Result<(), Diagnostic>,
    localization: &Localization,
    reference: &ReferenceGenerator,
    sample: Option<&ErrorSample>,
) -> (Findings, LimitSet) {
    let parameters = &cycle.constants.parameters;
    let error = sample.map(|sample| &sample.error);
    let (near_singular, conditioned) = localization.check_condition(parameters.condition);
    let engagement =
        conditioned.and(setpoint.status).and_then(|()| check_engage_tolerance(parameters, error));
    let (mut tracking, mut active_limits) = (Ok(()), near_singular);
    if cycle.state.has_control() {
        tracking = check_following_error(parameters, error, &mut active_limits)
            .and_then(|()| check_deadline(input))
            .and_then(|()| match cycle.state {
                State::Engaging | State::Active => setpoint.status,
                _ => reference.check_stroke(cycle.constants, setpoint.valid, cycle.release_ns),
            });
    }
    let tracking = tracking.and(conditioned);
    let has_ended = reference.has_ended(cycle.release_ns);
    (Findings { localization: platform, engagement, tracking, has_ended }, active_limits)
}

/// Control may begin only if closing the loop does not itself move the platform: near the setpoint in pose and velocity.
fn check_engage_tolerance(parameters: &Parameters, error: Option<&TrackingError>) -> Result<(), Diagnostic> {
    let Some(error) = error else { return Err(DiagnosticCode::NoSetpoint.into()) };
    let ratio = error.tolerance_ratio(parameters);
    if ratio <= 1.0 { Ok(()) } else { Err(Diagnostic::new(DiagnosticCode::SetpointTooFar, ratio, 1.0)) }
}

fn check_following_error(
    parameters: &Parameters,
    error: Option<&TrackingError>,
    active: &mut LimitSet,
) -> Result<(), Diagnostic> {
    let Some(TrackingError { pose, .. }) = error else { return Ok(()) };
    let Parameters { following_position, following_orientation, .. } = parameters;
    let ratio = (pose.linear.norm() / following_position).max(pose.angular.norm() / following_orientation);
    if active.check(Limit::Following, ratio) {
        return Ok(());
    }
    Err(Diagnostic::new(DiagnosticCode::FollowingError, ratio, 1.0))
}

fn check_deadline(input: &Input) -> Result<(), Diagnostic> {
    if input.deadline_missed { Err(DiagnosticCode::DeadlineMissed.into()) } else { Ok(()) }
}
