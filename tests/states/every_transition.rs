//! Every state with every cause and goal, every request, every combination of findings.

use hexad::control::diagnostic::{Diagnostic, DiagnosticCode, Reaction};
use hexad::control::state::{Request, State};
use hexad::control::supervisor::{AfterStop, Findings, SupervisorState, next};
use rayon::prelude::*;

use super::oracle;

const GOALS: [AfterStop; 3] = [AfterStop::Standby, AfterStop::Park, AfterStop::Fault];

/// A request of an operator has no number.
fn numbered(code: DiagnosticCode) -> Diagnostic {
    let value = if code == DiagnosticCode::OperatorRequest { 0.0 } else { 1.0 };
    Diagnostic::new(code, value, 0.0)
}

/// Every code there is with a number, and none.
fn verdicts(value: f64) -> Vec<Result<(), Diagnostic>> {
    let diagnostics = DiagnosticCode::ALL.iter().map(|code| Err(Diagnostic::new(*code, value, 0.0)));
    [Ok(())].into_iter().chain(diagnostics).collect()
}

fn requests() -> Vec<Option<Request>> {
    [None].into_iter().chain(Request::ALL.map(Some)).collect()
}

/// Calls `check` with all of them; returns how many there were. Whether control may begin is of no interest
/// where it has begun, or after a fault: two verdicts show that.
fn every(
    check: impl Fn(SupervisorState, Option<Request>, &Findings, AfterStop, (SupervisorState, Option<Diagnostic>))
    + Sync,
) -> u64 {
    let modes: Vec<_> = State::ALL
        .into_iter()
        .flat_map(|state| GOALS.map(|after| (state, after)))
        .flat_map(|(state, after)| {
            DiagnosticCode::ALL.iter().map(move |code| SupervisorState {
                state,
                diagnostic: numbered(*code),
                after,
            })
        })
        .collect();
    let [localizations, trackings, engagements] = [2.0, 3.0, 4.0].map(verdicts);
    let requests = requests();
    let of_mode = |mode: &SupervisorState| {
        let idle = matches!(mode.state, State::Off | State::Standby);
        let engagements = if idle { &engagements[..] } else { &engagements[..2] };
        let mut count = 0;
        for localization in &localizations {
            for tracking in &trackings {
                for engagement in engagements {
                    for has_ended in [false, true] {
                        let found = Findings {
                            localization: *localization,
                            engagement: *engagement,
                            tracking: *tracking,
                            has_ended,
                        };
                        for request in &requests {
                            for after_loss in GOALS {
                                let then = next(*mode, *request, &found, after_loss);
                                check(*mode, *request, &found, after_loss, then);
                                count += 1;
                            }
                        }
                    }
                }
            }
        }
        count
    };
    modes.par_iter().map(of_mode).sum()
}

#[test]
fn every_transition_is_the_documented_one() {
    let count = every(|mode, request, found, after_loss, then| {
        let wanted = oracle::next(mode, request, found, after_loss);
        assert!(then == wanted, "{mode:?} {request:?} {found:?} {after_loss:?}: {then:?}, not {wanted:?}");
    });
    let causes = DiagnosticCode::ALL.len() as u64;
    let (modes, rest) = (3 * causes, 7 * (causes + 1).pow(2) * 2 * 3);
    assert_eq!(count, modes * rest * (2 * (causes + 1) + 5 * 2));
}

/// What must hold whatever the table says.
#[test]
fn no_transition_takes_force_without_being_asked() {
    every(|mode, request, found, _, (then, refused)| {
        let what = || format!("{mode:?} {request:?} {found:?}: {then:?} {refused:?}");
        let is = |what| request == Some(what);
        let (had, has) = (mode.state.has_control(), then.state.has_control());
        // Control begins only by engage or park, with a known pose, and not out of a fault.
        assert!(had || !has || is(Request::Engage) || is(Request::Park), "{}", what());
        assert!(!has || found.localization.is_ok(), "{}", what());
        assert!(mode.state != State::Fault || !has, "{}", what());
        assert!(then.state != State::Engaging || had || found.engagement.is_ok(), "{}", what());
        // A fault is left only by clear, and clear leads to no force.
        assert!(mode.state != State::Fault || then.state == State::Fault || is(Request::Clear), "{}", what());
        assert!(!is(Request::Clear) || had || !has, "{}", what());
        // Active is reached only on the setpoint, and followed only while it can be.
        assert!(
            then.state != State::Active || matches!(mode.state, State::Engaging | State::Active),
            "{}",
            what()
        );
        assert!(
            !matches!(then.state, State::Engaging | State::Active) || !had || found.tracking.is_ok(),
            "{}",
            what()
        );
        // What brakes, brakes now; off and estop let go now.
        let brakes = found.tracking.is_err_and(|diagnostic| diagnostic.code.reaction() == Reaction::Brake);
        assert!(!(had && brakes && has), "{}", what());
        assert!(!(is(Request::Off) || is(Request::Estop)) || !has, "{}", what());
        assert!(!is(Request::Estop) || then.state == State::Fault, "{}", what());
        // Whoever is refused has asked, and nothing was begun for them.
        assert!(refused.is_none() || request.is_some(), "{}", what());
        assert!(refused.is_none() || had || !has, "{}", what());
    });
}
