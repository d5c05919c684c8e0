//! Every state with every cause and goal, every request, every combination of findings.

use hexad::control::signals::diagnostic::{Diagnostic, DiagnosticCode, Reaction};
use hexad::control::signals::state::AfterStop;
use hexad::control::signals::state::{Request, State};
use hexad::control::supervision::supervisor::{Findings, SupervisorState, next};
use rayon::prelude::*;

use super::oracle;
use hexad_support::certificate::{Certificate, cases};

const GOALS: [AfterStop; 3] = [AfterStop::Standby, AfterStop::Park, AfterStop::Fault];

/// Every so manieth state with goal and cause in a short run: each state and goal, each cause in some.
const SHORT_MODES: usize = 5;

/// A code of each kind that the state machine treats differently: brakes, holds (two), no fault, stops, lost (two).
const DISTINCT: [DiagnosticCode; 7] = [
    DiagnosticCode::FollowingError,
    DiagnosticCode::HoldingPose,
    DiagnosticCode::SetpointTooFar,
    DiagnosticCode::WithoutSetpoints,
    DiagnosticCode::OperatorRequest,
    DiagnosticCode::SetpointJumped,
    DiagnosticCode::SetpointLost,
];

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

/// Verdicts on pose and tracking. Each decides alone: all of the one where the other is good, and pairs of those that are treated
/// differently; in a long run all pairs.
fn courses() -> Vec<[Result<(), Diagnostic>; 2]> {
    let is_distinct =
        |verdict: &Result<(), Diagnostic>| verdict.is_err_and(|found| DISTINCT.contains(&found.code));
    let [localizations, trackings] = [2.0, 3.0].map(verdicts);
    let pairs = localizations.iter().flat_map(|pose| trackings.iter().map(|tracking| [*pose, *tracking]));
    let is_wanted = |[pose, tracking]: &[Result<(), Diagnostic>; 2]| {
        Certificate::is_long()
            || pose.is_ok()
            || tracking.is_ok()
            || is_distinct(pose) && is_distinct(tracking)
    };
    pairs.filter(is_wanted).collect()
}

/// Verdicts on the start of control and on the setpoint to start on. Each decides alone: all of the one where the other is
/// good, and a pair that is not. Neither is of interest where control has begun, or after a fault: two of each show that.
fn starts(is_idle: bool) -> Vec<[Result<(), Diagnostic>; 2]> {
    let [starts, engagements] = [4.0, 5.0].map(verdicts);
    let pairs = starts.iter().enumerate().flat_map(|(i, start)| {
        engagements.iter().enumerate().map(move |(j, engagement)| ((i, j), [*start, *engagement]))
    });
    let is_wanted = |(i, j): (usize, usize)| i < 2 && j < 2 || is_idle && i.min(j) == 0;
    pairs.filter(|(at, _)| is_wanted(*at)).map(|(_, pair)| pair).collect()
}

/// Calls `check` with all of them; returns how many there were.
fn every(
    check: impl Fn(SupervisorState, Option<Request>, &Findings, AfterStop, (SupervisorState, Option<Diagnostic>))
    + Sync,
) -> u64 {
    let modes = State::ALL.into_iter().flat_map(|state| GOALS.map(|after| (state, after))).flat_map(
        |(state, after)| {
            DiagnosticCode::ALL.iter().map(move |code| SupervisorState {
                state,
                diagnostic: numbered(*code),
                after,
            })
        },
    );
    let modes = cases(modes, SHORT_MODES);
    let courses = courses();
    let (idle_starts, other_starts) = (starts(true), starts(false));
    let requests = requests();
    let certificate = Certificate::new("transitions", modes.len() as u64, modes.len() as u64);
    let of_mode = |mode: &SupervisorState| {
        let idle = matches!(mode.state, State::Off | State::Standby);
        let starts = if idle { &idle_starts } else { &other_starts };
        let mut count = 0;
        for [localization, tracking] in &courses {
            for [start, engagement] in starts {
                for (has_ended, sensor_may_be_frozen) in [(false, false), (true, false), (false, true)] {
                    let found = Findings {
                        localization: *localization,
                        start: *start,
                        engagement: *engagement,
                        tracking: *tracking,
                        sensor_may_be_frozen,
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
        certificate.advance(1);
        count
    };
    modes.par_iter().map(of_mode).sum()
}

#[test]
fn certificate_every_transition_is_the_documented_one() {
    let count = every(|mode, request, found, after_loss, then| {
        let wanted = oracle::next(mode, request, found, after_loss);
        assert!(then == wanted, "{mode:?} {request:?} {found:?} {after_loss:?}: {then:?}, not {wanted:?}");
        takes_no_force_unasked(mode, request, found, then);
    });
    let causes = DiagnosticCode::ALL.len() as u64;
    let courses = if Certificate::is_long() {
        (causes + 1).pow(2)
    } else {
        2 * causes + 1 + (DISTINCT.len() as u64).pow(2)
    };
    let rest = 7 * courses * 3 * 3;
    let (all, idle_starts) = (3 * causes * 7, 2 * (causes + 1));
    let every = if Certificate::is_long() { 1 } else { SHORT_MODES as u64 };
    let idle = (2 * 3 * causes).div_ceil(every);
    assert_eq!(count, rest * (idle * idle_starts + (all.div_ceil(every) - idle) * 4));
}

/// What must hold whatever the table says.
fn takes_no_force_unasked(
    mode: SupervisorState,
    request: Option<Request>,
    found: &Findings,
    (then, refused): (SupervisorState, Option<Diagnostic>),
) {
    let what = || format!("{mode:?} {request:?} {found:?}: {then:?} {refused:?}");
    let is = |what| request == Some(what);
    let (had, has) = (mode.state.has_control(), then.state.has_control());
    // Control begins only by engage or park, with a known pose, and not out of a fault.
    assert!(had || !has || is(Request::Engage) || is(Request::Park), "{}", what());
    assert!(!has || found.localization.is_ok(), "{}", what());
    assert!(mode.state != State::Fault || !has, "{}", what());
    assert!(then.state != State::Engaging || had || found.engagement.is_ok(), "{}", what());
    // Park begins with a stop, which must exist; no other state follows one without force.
    let begins_stop = !had && then.state == State::Stopping;
    let parks = is(Request::Park) && found.start.is_ok() && then.after == AfterStop::Park;
    assert!(!begins_stop || parks, "{}", what());
    assert!(had || !matches!(then.state, State::Active | State::Parking), "{}", what());
    // A fault is left only by clear, and clear leads to no force.
    assert!(mode.state != State::Fault || then.state == State::Fault || is(Request::Clear), "{}", what());
    assert!(!is(Request::Clear) || had || !has, "{}", what());
    // Active is reached only on the setpoint, and followed only while it can be. Without setpoints it can hold.
    assert!(
        then.state != State::Active || matches!(mode.state, State::Engaging | State::Active),
        "{}",
        what()
    );
    let holds = found.tracking.is_err_and(|diagnostic| oracle::HOLDS.contains(&diagnostic.code));
    let may_follow = found.tracking.is_ok() || holds && then.state == State::Engaging;
    assert!(!matches!(then.state, State::Engaging | State::Active) || !had || may_follow, "{}", what());
    // What is followed has no cause left from before.
    let follows = matches!(then.state, State::Engaging | State::Active);
    assert!(!follows || holds || then.diagnostic.code == DiagnosticCode::None, "{}", what());
    // What brakes, brakes now; off and estop let go now.
    let brakes = found.tracking.is_err_and(|diagnostic| diagnostic.code.reaction() == Reaction::Brake);
    assert!(!(had && brakes && has), "{}", what());
    assert!(!(is(Request::Off) || is(Request::Estop)) || !has, "{}", what());
    assert!(!is(Request::Estop) || then.state == State::Fault, "{}", what());
    // Whoever is refused has asked, and nothing was begun for them.
    assert!(refused.is_none() || request.is_some(), "{}", what());
    assert!(refused.is_none() || had || !has, "{}", what());
}
