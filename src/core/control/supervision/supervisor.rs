//! The state machine: the next state, as a pure and total function of requests and findings.
//!
//! Order of precedence: the emergency stop, a fault that brakes, `off`, a fault that stops, then the
//! transitions of the state itself. In states without force a fault is only reported: there is no force to
//! disable.
//!
//! Control begins in engaging, or by `park` in stopping: a platform that moves without force comes to rest
//! before it goes home. If the setpoint is lost and the policy is to hold the pose, engaging follows and not
//! stopping.

use serde::{Deserialize, Serialize};

use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode, Reaction};
use crate::control::signals::inputs::Input;
use crate::control::signals::state::AfterStop;
use crate::control::signals::state::{MessageId, OperatorRequest, Request, State};

/// State of the controller, with its reason and the goal of a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SupervisorState {
    /// State of the controller; it decides whether forces are applied.
    pub state: State,
    /// Why the state is not active, or soon will not be.
    pub diagnostic: Diagnostic,
    /// Goal of the stop; used only while stopping.
    pub after: AfterStop,
}

/// Findings of one cycle that decide the next state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Findings {
    /// Whether the pose is known, from valid measurements.
    pub localization: Result<(), Diagnostic>,
    /// Whether a verified stop exists for the motion of the platform without force. `engagement` includes
    /// this finding.
    pub start: Result<(), Diagnostic>,
    /// Whether control may begin on the setpoint.
    pub engagement: Result<(), Diagnostic>,
    /// Whether the reference can be followed further. A diagnostic that is no fault ends control by a stop.
    pub tracking: Result<(), Diagnostic>,
    /// Whether a length repeats itself: a stop under control might rely on a frozen sensor.
    pub sensor_may_be_frozen: bool,
    /// Whether the motion of engaging, stopping or parking has ended.
    pub has_ended: bool,
}

/// Third stage of the cycle: the state, and the answer to the last request.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct Supervisor {
    pub current: SupervisorState,
    /// Message of the last request that was carried out or refused.
    pub answered_message: MessageId,
    /// Why that request was refused; code `None` if it was not.
    pub request_diagnostic: Diagnostic,
    /// While engaging, the instant at which the reference came within the engage tolerance of its target \[ns\].
    pub near_since_ns: Option<u64>,
}

impl Supervisor {
    /// Whether the platform holds its pose, because setpoints were lost.
    pub fn holds_after_setpoint_loss(&self) -> bool {
        self.current.state == State::Engaging && self.current.diagnostic.code.holds_pose()
    }

    /// Request of an input, if it was not answered before. Each request is carried out once.
    pub fn new_request(&self, input: &Input) -> Option<OperatorRequest> {
        input.request.filter(|request| request.message != self.answered_message)
    }

    /// Decides the next state and returns it.
    pub fn decide(
        &mut self,
        request: Option<OperatorRequest>,
        findings: &Findings,
        after_loss: AfterStop,
    ) -> State {
        let (current, refusal) = next(self.current, request.map(|new| new.request), findings, after_loss);
        self.current = current;
        if let Some(OperatorRequest { message, .. }) = request {
            (self.answered_message, self.request_diagnostic) = (message, refusal.unwrap_or_default());
        }
        current.state
    }

    /// Enters the state fault, because no valid force could be computed.
    pub fn enter_fault(&mut self, diagnostic: Diagnostic) {
        self.current = fault(diagnostic);
    }
}

/// Returns the next state and, if a request was refused, the reason. `after_loss` is the goal of the stop
/// after a loss of the setpoint.
pub fn next(
    current: SupervisorState,
    request: Option<Request>,
    findings: &Findings,
    after_loss: AfterStop,
) -> (SupervisorState, Option<Diagnostic>) {
    if request == Some(Request::Estop) {
        return (fault(DiagnosticCode::EmergencyStop.into()), None);
    }
    if current.state.has_control() {
        // Control ends without a known pose, whatever the reason.
        if let Err(diagnostic) = findings.localization {
            return (fault(diagnostic), None);
        }
        if let Err(diagnostic) = findings.tracking
            && diagnostic.code.reaction() == Reaction::Brake
        {
            return (fault(diagnostic), None);
        }
        // The readings of a frozen sensor may look like a change of payload or an impact.
        let under_way = (current.state == State::Stopping).then_some(current.diagnostic);
        let change = findings
            .tracking
            .err()
            .into_iter()
            .chain(under_way)
            .find(|cause| is_payload_change_or_impact(cause.code));
        if let Some(cause) = change.filter(|_| findings.sensor_may_be_frozen) {
            return (fault(cause), None);
        }
    }
    if request == Some(Request::Off) && current.state != State::Fault {
        return (OFF_BY_REQUEST, None);
    }
    match current.state {
        State::Off | State::Standby => without_force(current, request, findings),
        State::Fault => in_fault(current, request),
        State::Engaging | State::Active => following(current, request, findings, after_loss),
        State::Stopping => stopping(current, request, findings),
        State::Parking => parking(current, request, findings),
    }
}

/// Whether readings alone have shown the event, and its reaction is a stop under control.
fn is_payload_change_or_impact(code: DiagnosticCode) -> bool {
    matches!(code, DiagnosticCode::PayloadChanged | DiagnosticCode::Impact)
}

/// The state off by request of an operator. It does not become standby by itself.
const OFF_BY_REQUEST: SupervisorState =
    SupervisorState { state: State::Off, diagnostic: REQUESTED, after: AfterStop::Standby };

const REQUESTED: Diagnostic =
    Diagnostic { code: DiagnosticCode::OperatorRequest, value: 0.0, bound: 0.0, index: 0 };

fn fault(diagnostic: Diagnostic) -> SupervisorState {
    SupervisorState { state: State::Fault, diagnostic, ..SupervisorState::default() }
}

fn stop(diagnostic: Diagnostic, after: AfterStop) -> SupervisorState {
    SupervisorState { state: State::Stopping, diagnostic, after }
}

fn standby(diagnostic: Diagnostic) -> SupervisorState {
    SupervisorState { state: State::Standby, diagnostic, ..SupervisorState::default() }
}

fn without_force(
    current: SupervisorState,
    request: Option<Request>,
    findings: &Findings,
) -> (SupervisorState, Option<Diagnostic>) {
    let ready = match findings.localization {
        Ok(()) => standby(findings.engagement.err().unwrap_or(DiagnosticCode::ReadyToEngage.into())),
        Err(diagnostic) => SupervisorState { state: State::Off, diagnostic, ..SupervisorState::default() },
    };
    let rest = if current == OFF_BY_REQUEST { current } else { ready };
    match request {
        Some(Request::Engage) => match findings.localization.and(findings.engagement) {
            Ok(()) => (SupervisorState { state: State::Engaging, ..SupervisorState::default() }, None),
            Err(diagnostic) => (rest, Some(diagnostic)),
        },
        // A driver acknowledges faults of drives when the daemon's fault ends: without one nothing would happen.
        Some(Request::Clear) => {
            (ready, findings.engagement.err().filter(|found| found.code == DiagnosticCode::DriveFault))
        }
        // Parking needs no setpoint. A platform that still moves is brought to rest first.
        Some(Request::Park) => match findings.localization.and(findings.start) {
            Ok(()) => (stop(REQUESTED, AfterStop::Park), None),
            Err(diagnostic) => (rest, Some(diagnostic)),
        },
        None | Some(Request::Stop | Request::Off | Request::Estop) => (rest, None),
    }
}

fn in_fault(current: SupervisorState, request: Option<Request>) -> (SupervisorState, Option<Diagnostic>) {
    match request {
        Some(Request::Clear) => (SupervisorState::default(), None),
        Some(Request::Engage | Request::Park) => (current, Some(DiagnosticCode::InvalidInState.into())),
        Some(Request::Stop | Request::Off | Request::Estop) | None => (current, None),
    }
}

fn following(
    current: SupervisorState,
    request: Option<Request>,
    findings: &Findings,
    after_loss: AfterStop,
) -> (SupervisorState, Option<Diagnostic>) {
    let (mut current, mut has_ended) = (current, findings.has_ended);
    if let Err(diagnostic) = findings.tracking {
        let after = match diagnostic.code {
            // The platform holds its pose and engages again from there.
            code if code.holds_pose() => {
                let resumes = code == DiagnosticCode::SetpointTooFar && request == Some(Request::Engage);
                let diagnostic = if resumes { Diagnostic::default() } else { diagnostic };
                (current, has_ended) =
                    (SupervisorState { state: State::Engaging, diagnostic, ..current }, false);
                None
            }
            DiagnosticCode::SetpointLost | DiagnosticCode::WithoutSetpoints => Some(after_loss),
            code if code.is_fault() => Some(AfterStop::Fault),
            _ => Some(AfterStop::Standby),
        };
        if let Some(after) = after {
            return (stop(diagnostic, after), None);
        }
    } else {
        current.diagnostic = Diagnostic::default();
    }
    match request {
        Some(Request::Stop) => (stop(REQUESTED, AfterStop::Standby), None),
        Some(Request::Park) => (stop(REQUESTED, AfterStop::Park), None),
        Some(Request::Clear) => (current, Some(DiagnosticCode::InvalidInState.into())),
        Some(Request::Engage | Request::Off | Request::Estop) | None => {
            let state = if has_ended { State::Active } else { current.state };
            (SupervisorState { state, ..current }, None)
        }
    }
}

fn stopping(
    current: SupervisorState,
    request: Option<Request>,
    findings: &Findings,
) -> (SupervisorState, Option<Diagnostic>) {
    let (current, refused) = match (request, current.after) {
        _ if findings.tracking.is_err() && current.after != AfterStop::Fault => (
            findings.tracking.map_or_else(|diagnostic| stop(diagnostic, AfterStop::Fault), |()| current),
            None,
        ),
        (Some(Request::Park), AfterStop::Standby) => (stop(REQUESTED, AfterStop::Park), None),
        (Some(Request::Stop), AfterStop::Park) => (stop(REQUESTED, AfterStop::Standby), None),
        (Some(Request::Engage | Request::Clear | Request::Park), _) => {
            (current, Some(DiagnosticCode::InvalidInState.into()))
        }
        _ => (current, None),
    };
    if !findings.has_ended {
        return (current, refused);
    }
    let rest = match current.after {
        AfterStop::Standby => standby(present(current.diagnostic.code, findings)),
        AfterStop::Park => SupervisorState { state: State::Parking, after: AfterStop::default(), ..current },
        AfterStop::Fault => fault(current.diagnostic),
    };
    (rest, refused)
}

fn parking(
    current: SupervisorState,
    request: Option<Request>,
    findings: &Findings,
) -> (SupervisorState, Option<Diagnostic>) {
    if let Err(diagnostic) = findings.tracking {
        return (stop(diagnostic, AfterStop::Fault), None);
    }
    match request {
        Some(Request::Stop) => return (stop(REQUESTED, AfterStop::Standby), None),
        Some(Request::Engage | Request::Clear) => {
            return (current, Some(DiagnosticCode::InvalidInState.into()));
        }
        Some(Request::Park | Request::Off | Request::Estop) | None => {}
    }
    (if findings.has_ended { OFF_BY_REQUEST } else { current }, None)
}

/// Diagnostic of a code, with the value of this cycle if the code still prevents control.
fn present(code: DiagnosticCode, findings: &Findings) -> Diagnostic {
    findings.engagement.err().filter(|found| found.code == code).unwrap_or(code.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOUND: Diagnostic =
        Diagnostic { code: DiagnosticCode::FollowingError, value: 0.03, bound: 0.02, index: 4 };
    const OTHER: Diagnostic =
        Diagnostic { code: DiagnosticCode::MeasurementLost, value: 9.0, bound: 0.4, index: 1 };
    const IN_ORDER: Findings = Findings {
        localization: Ok(()),
        start: Ok(()),
        engagement: Ok(()),
        tracking: Ok(()),
        sensor_may_be_frozen: false,
        has_ended: false,
    };

    /// State after one cycle without a request.
    fn after(current: SupervisorState, findings: &Findings) -> SupervisorState {
        next(current, None, findings, AfterStop::Fault).0
    }

    #[test]
    fn a_fault_keeps_value_and_bound_of_its_first_cycle() {
        let active = SupervisorState { state: State::Active, ..SupervisorState::default() };
        for findings in
            [Findings { localization: Err(FOUND), ..IN_ORDER }, Findings { tracking: Err(FOUND), ..IN_ORDER }]
        {
            let mut current = after(active, &findings);
            assert_eq!((current.state, current.diagnostic), (State::Fault, FOUND), "{findings:?}");
            for later in [IN_ORDER, Findings { localization: Err(OTHER), tracking: Err(OTHER), ..IN_ORDER }] {
                current = after(current, &later);
                assert_eq!((current.state, current.diagnostic), (State::Fault, FOUND), "{later:?}");
            }
        }
    }

    #[test]
    fn a_stop_that_ends_in_a_fault_keeps_value_and_bound_of_its_cause() {
        let cause = Diagnostic { code: DiagnosticCode::SetpointTooFast, ..FOUND };
        let active = SupervisorState { state: State::Active, ..SupervisorState::default() };
        let mut current = after(active, &Findings { tracking: Err(cause), ..IN_ORDER });
        assert_eq!((current.state, current.diagnostic), (State::Stopping, cause));
        current = after(current, &IN_ORDER);
        assert_eq!((current.state, current.diagnostic), (State::Stopping, cause));
        current = after(current, &Findings { has_ended: true, ..IN_ORDER });
        assert_eq!((current.state, current.diagnostic), (State::Fault, cause));
    }

    #[test]
    fn a_stop_that_ends_in_a_fault_keeps_its_cause_beside_a_later_one() {
        let stopping = stop(FOUND, AfterStop::Fault);
        let later = Findings { tracking: Err(DiagnosticCode::SetpointTooFast.into()), ..IN_ORDER };
        assert_eq!(after(stopping, &later), stopping);
        // A stop for another reason becomes one that ends in a fault.
        let current = after(stop(REQUESTED, AfterStop::Standby), &later);
        assert_eq!(current, stop(DiagnosticCode::SetpointTooFast.into(), AfterStop::Fault));
    }

    /// Standby shows the reason of the stop, with the value of this cycle if it still prevents control.
    #[test]
    fn standby_after_a_stop_shows_the_present_value_of_its_reason() {
        let ended = Findings { has_ended: true, ..IN_ORDER };
        let stopping = stop(Diagnostic { value: 0.5, ..FOUND }, AfterStop::Standby);
        let of_code = Diagnostic::from(FOUND.code);
        for (engagement, shown) in [(Ok(()), of_code), (Err(FOUND), FOUND), (Err(OTHER), of_code)] {
            let current = after(stopping, &Findings { engagement, ..ended });
            assert_eq!((current.state, current.diagnostic), (State::Standby, shown));
        }
    }

    /// A stop under control after a change relies on readings. If a reading repeats itself, the brakes close,
    /// at once or during the stop.
    #[test]
    fn a_change_that_a_frozen_sensor_may_have_made_closes_the_brakes() {
        let active = SupervisorState { state: State::Active, ..SupervisorState::default() };
        for code in [DiagnosticCode::PayloadChanged, DiagnosticCode::Impact, DiagnosticCode::DeadlineMissed] {
            let brakes = code != DiagnosticCode::DeadlineMissed;
            let found = Findings { tracking: Err(code.into()), ..IN_ORDER };
            let expected = |current: SupervisorState| {
                let state = if brakes { State::Fault } else { State::Stopping };
                assert_eq!((current.state, current.diagnostic.code), (state, code));
            };
            expected(after(active, &Findings { sensor_may_be_frozen: true, ..found }));
            let stopping = after(active, &found);
            assert_eq!(stopping.state, State::Stopping);
            expected(after(stopping, &Findings { sensor_may_be_frozen: true, ..IN_ORDER }));
        }
        assert_eq!(after(active, &Findings { sensor_may_be_frozen: true, ..IN_ORDER }).state, State::Active);
    }
}
