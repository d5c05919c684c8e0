//! What the documents say must follow, written as a list: the first line that applies counts.

use hexad::control::state::{Cause, Reaction, Request, State};
use hexad::control::supervisor::{AfterStop, Findings, Mode};

type Next = (Mode, Option<Cause>);

fn mode(state: State, cause: Cause, after: AfterStop) -> Mode {
    Mode { state, cause, after }
}

fn plain(state: State, cause: Cause) -> Mode {
    mode(state, cause, AfterStop::Standby)
}

/// What a platform without force shows: whether it could engage, and if not, why.
fn shown(findings: &Findings) -> Mode {
    match (findings.located, findings.engageable) {
        (Err(cause), _) => plain(State::Off, cause),
        (Ok(()), Err(cause)) => plain(State::Standby, cause),
        (Ok(()), Ok(())) => plain(State::Standby, Cause::NotAsked),
    }
}

/// Where a stop ends.
fn after_stop(now: Mode) -> Mode {
    match now.after {
        AfterStop::Standby => plain(State::Standby, now.cause),
        AfterStop::Park => plain(State::Parking, now.cause),
        AfterStop::Fault => plain(State::Fault, now.cause),
    }
}

pub fn next(now: Mode, request: Option<Request>, found: &Findings, after_loss: AfterStop) -> Next {
    use Request::{Clear, Engage, Estop, Off, Park, Stop};
    use State as S;
    let is = |what| request == Some(what);
    let asks = request.is_some();
    let controls = matches!(now.state, S::Engaging | S::Active | S::Stopping | S::Parking);
    let follows = matches!(now.state, S::Engaging | S::Active);
    let idle = matches!(now.state, S::Off | S::Standby);
    let off = plain(S::Off, Cause::Asked);
    let lost = found.located.err();
    let trouble = found.following.err();
    let brakes = trouble.filter(|cause| cause.reaction() == Reaction::Brake);
    let to_stop = |cause, after| (mode(S::Stopping, cause, after), None);
    let refuse = |why| (now, Some(why));
    // Nobody has switched it off: it shows what there is.
    let rest = if idle && now == off { now } else { shown(found) };
    let could_engage = found.located.and(found.engageable);

    let table: &[(bool, &dyn Fn() -> Next)] = &[
        (is(Estop), &|| (plain(S::Fault, Cause::EmergencyStop), None)),
        (controls && lost.is_some(), &|| (plain(S::Fault, lost.unwrap()), None)),
        (controls && brakes.is_some(), &|| (plain(S::Fault, brakes.unwrap()), None)),
        // A fault stays until it is cleared, whatever else is asked.
        (now.state == S::Fault && is(Clear), &|| (plain(S::Off, Cause::None), None)),
        (now.state == S::Fault && (is(Engage) || is(Park)), &|| refuse(Cause::NotNow)),
        (now.state == S::Fault, &|| (now, None)),
        (is(Off), &|| (off, None)),
        // Without force.
        (idle && is(Engage) && could_engage.is_ok(), &|| (plain(S::Engaging, Cause::None), None)),
        (idle && is(Engage), &|| (rest, could_engage.err())),
        (idle && is(Park) && lost.is_none(), &|| (plain(S::Parking, Cause::Asked), None)),
        (idle && is(Park), &|| (rest, lost)),
        (idle && is(Clear), &|| (shown(found), None)),
        (idle, &|| (rest, None)),
        // What cannot be followed any more ends in a stop, whatever is asked.
        (follows && trouble == Some(Cause::SetpointLost), &|| to_stop(Cause::SetpointLost, after_loss)),
        (follows && trouble.is_some_and(Cause::is_fault), &|| to_stop(trouble.unwrap(), AfterStop::Fault)),
        (follows && trouble.is_some(), &|| to_stop(trouble.unwrap(), AfterStop::Standby)),
        (follows && is(Stop), &|| to_stop(Cause::Asked, AfterStop::Standby)),
        (follows && is(Park), &|| to_stop(Cause::Asked, AfterStop::Park)),
        (follows && is(Clear), &|| refuse(Cause::NotNow)),
        (follows && found.arrived, &|| (mode(S::Active, now.cause, now.after), None)),
        (follows, &|| (now, None)),
        // On the way home.
        (now.state == S::Parking && trouble.is_some(), &|| to_stop(trouble.unwrap(), AfterStop::Fault)),
        (now.state == S::Parking && is(Stop), &|| to_stop(Cause::Asked, AfterStop::Standby)),
        (now.state == S::Parking && (is(Engage) || is(Clear)), &|| refuse(Cause::NotNow)),
        (now.state == S::Parking && found.arrived, &|| (off, None)),
        (now.state == S::Parking, &|| (now, None)),
    ];
    if let Some((_, then)) = table.iter().find(|(applies, _)| *applies) {
        return then();
    }
    // Stopping: a fault on the way, or another wish, changes what comes after; then it goes on, or is over.
    let (goal, refused) = if let Some(cause) = trouble.filter(|_| now.after != AfterStop::Fault) {
        (mode(S::Stopping, cause, AfterStop::Fault), None)
    } else if is(Park) && now.after == AfterStop::Standby {
        (mode(S::Stopping, Cause::Asked, AfterStop::Park), None)
    } else if is(Stop) && now.after == AfterStop::Park {
        (mode(S::Stopping, Cause::Asked, AfterStop::Standby), None)
    } else {
        (now, (asks && !is(Stop)).then_some(Cause::NotNow))
    };
    (if found.arrived { after_stop(goal) } else { goal }, refused)
}
