//! What the documents say must follow, written as a list: the first line that applies counts.

use hexad::control::signals::diagnostic::{Diagnostic, DiagnosticCode, Reaction};
use hexad::control::signals::state::AfterStop;
use hexad::control::signals::state::{Request, State};
use hexad::control::supervision::supervisor::{Findings, SupervisorState};

type Next = (SupervisorState, Option<Diagnostic>);

fn mode(state: State, why: impl Into<Diagnostic>, after: AfterStop) -> SupervisorState {
    SupervisorState { state, diagnostic: why.into(), after }
}

fn plain(state: State, why: impl Into<Diagnostic>) -> SupervisorState {
    mode(state, why, AfterStop::Standby)
}

/// What a platform without force shows: whether it could engage, and if not, why.
fn shown(findings: &Findings) -> SupervisorState {
    match (findings.localization, findings.engagement) {
        (Err(cause), _) => plain(State::Off, cause),
        (Ok(()), Err(cause)) => plain(State::Standby, cause),
        (Ok(()), Ok(())) => plain(State::Standby, DiagnosticCode::ReadyToEngage),
    }
}

/// Where a stop ends.
fn after_stop(now: SupervisorState, findings: &Findings) -> SupervisorState {
    let code = now.diagnostic.code;
    // In standby the number is that of this cycle, if there is one.
    let current = findings.engagement.err().filter(|found| found.code == code);
    match now.after {
        AfterStop::Standby => plain(State::Standby, current.unwrap_or(code.into())),
        AfterStop::Park => plain(State::Parking, now.diagnostic),
        AfterStop::Fault => plain(State::Fault, now.diagnostic),
    }
}

fn changes(cause: Option<Diagnostic>) -> Option<Diagnostic> {
    cause.filter(|it| [DiagnosticCode::PayloadChanged, DiagnosticCode::Impact].contains(&it.code))
}

/// Without setpoints, or with distant ones after that.
pub const HOLDS: [DiagnosticCode; 2] = [DiagnosticCode::HoldingPose, DiagnosticCode::SetpointTooFar];
const LOSSES: [DiagnosticCode; 2] = [DiagnosticCode::SetpointLost, DiagnosticCode::WithoutSetpoints];

#[expect(clippy::too_many_lines, reason = "the state machine again, written from its table")]
pub fn next(now: SupervisorState, request: Option<Request>, found: &Findings, after_loss: AfterStop) -> Next {
    use Request::{Clear, Engage, Estop, Off, Park, Stop};
    use State as S;
    let is = |what| request == Some(what);
    let asks = request.is_some();
    let controls = matches!(now.state, S::Engaging | S::Active | S::Stopping | S::Parking);
    let follows = matches!(now.state, S::Engaging | S::Active);
    let idle = matches!(now.state, S::Off | S::Standby);
    let off = plain(S::Off, DiagnosticCode::OperatorRequest);
    let lost = found.localization.err();
    let trouble = found.tracking.err();
    let brakes = trouble.filter(|found| found.code.reaction() == Reaction::Brake);
    let to_stop = |why: Diagnostic, after| (mode(S::Stopping, why, after), None);
    let requested = Diagnostic::from(DiagnosticCode::OperatorRequest);
    let refuse = |why: DiagnosticCode| (now, Some(why.into()));
    // Nobody has switched it off: it shows what there is.
    let rest = if idle && now == off { now } else { shown(found) };
    let could_engage = found.localization.and(found.engagement);
    let could_start = found.localization.and(found.start);
    // Without setpoints it holds its pose, if the policy lets it, and is engaging until there are some again.
    let holds = trouble.filter(|found| HOLDS.contains(&found.code));
    // Where only its distance keeps it from the setpoint, an operator may let it go there.
    let is_resumed = is(Engage) && holds.is_some_and(|found| found.code == DiagnosticCode::SetpointTooFar);
    let goes_on = match holds {
        Some(_) if is_resumed => mode(S::Engaging, DiagnosticCode::None, now.after),
        Some(cause) => mode(S::Engaging, cause, now.after),
        None => mode(now.state, DiagnosticCode::None, now.after),
    };
    let ends = trouble.filter(|_| follows && holds.is_none());

    let table: &[(bool, &dyn Fn() -> Next)] = &[
        (is(Estop), &|| (plain(S::Fault, DiagnosticCode::EmergencyStop), None)),
        (controls && lost.is_some(), &|| (plain(S::Fault, lost.unwrap()), None)),
        (controls && brakes.is_some(), &|| (plain(S::Fault, brakes.unwrap()), None)),
        // A payload or an impact, found now or stopped for, that a sensor which repeats itself may have made.
        (controls && found.sensor_may_be_frozen && changes(trouble).is_some(), &|| {
            (plain(S::Fault, changes(trouble).unwrap()), None)
        }),
        (
            now.state == S::Stopping && found.sensor_may_be_frozen && changes(Some(now.diagnostic)).is_some(),
            &|| (plain(S::Fault, now.diagnostic), None),
        ),
        // A fault stays until it is cleared, whatever else is asked.
        (now.state == S::Fault && is(Clear), &|| (plain(S::Off, DiagnosticCode::None), None)),
        (now.state == S::Fault && (is(Engage) || is(Park)), &|| refuse(DiagnosticCode::InvalidInState)),
        (now.state == S::Fault, &|| (now, None)),
        (is(Off), &|| (off, None)),
        // Without force.
        (idle && is(Engage) && could_engage.is_ok(), &|| (plain(S::Engaging, DiagnosticCode::None), None)),
        (idle && is(Engage), &|| (rest, could_engage.err())),
        // It may move without force: first it comes to rest.
        (idle && is(Park) && could_start.is_ok(), &|| to_stop(requested, AfterStop::Park)),
        (idle && is(Park), &|| (rest, could_start.err())),
        // A drive's fault is none of the daemon's, which it could clear.
        (idle && is(Clear), &|| {
            (shown(found), found.engagement.err().filter(|it| it.code == DiagnosticCode::DriveFault))
        }),
        (idle, &|| (rest, None)),
        // What cannot be followed any more ends in a stop, whatever is asked.
        (ends.is_some_and(|found| LOSSES.contains(&found.code)), &|| to_stop(ends.unwrap(), after_loss)),
        (ends.is_some_and(|found| found.code.is_fault()), &|| to_stop(ends.unwrap(), AfterStop::Fault)),
        (ends.is_some(), &|| to_stop(ends.unwrap(), AfterStop::Standby)),
        (follows && is(Stop), &|| to_stop(requested, AfterStop::Standby)),
        (follows && is(Park), &|| to_stop(requested, AfterStop::Park)),
        (follows && is(Clear), &|| (goes_on, Some(DiagnosticCode::InvalidInState.into()))),
        (follows && found.has_ended && holds.is_none(), &|| {
            (SupervisorState { state: S::Active, ..goes_on }, None)
        }),
        (follows, &|| (goes_on, None)),
        // On the way home.
        (now.state == S::Parking && trouble.is_some(), &|| to_stop(trouble.unwrap(), AfterStop::Fault)),
        (now.state == S::Parking && is(Stop), &|| to_stop(requested, AfterStop::Standby)),
        (now.state == S::Parking && (is(Engage) || is(Clear)), &|| refuse(DiagnosticCode::InvalidInState)),
        (now.state == S::Parking && found.has_ended, &|| (off, None)),
        (now.state == S::Parking, &|| (now, None)),
    ];
    if let Some((_, then)) = table.iter().find(|(applies, _)| *applies) {
        return then();
    }
    // Stopping: a fault on the way, or another wish, changes what comes after; then it goes on, or is over.
    let (goal, refused) = if let Some(cause) = trouble.filter(|_| now.after != AfterStop::Fault) {
        (mode(S::Stopping, cause, AfterStop::Fault), None)
    } else if is(Park) && now.after == AfterStop::Standby {
        (mode(S::Stopping, DiagnosticCode::OperatorRequest, AfterStop::Park), None)
    } else if is(Stop) && now.after == AfterStop::Park {
        (mode(S::Stopping, DiagnosticCode::OperatorRequest, AfterStop::Standby), None)
    } else {
        (now, (asks && !is(Stop)).then_some(DiagnosticCode::InvalidInState.into()))
    };
    (if found.has_ended { after_stop(goal, found) } else { goal }, refused)
}
