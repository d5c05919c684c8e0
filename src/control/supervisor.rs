//! The state machine: which state follows, as a pure and total function.
//!
//! Order of precedence: the emergency stop, a fault that brakes, `off`, a fault that stops, then what the
//! state itself does. In states without force a fault is only shown: there is nothing to take away.

use super::state::{Cause, Reaction, Request, State};

/// What a platform does once it has come to rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AfterStop {
    /// Stands, with its brakes closed.
    #[default]
    Standby,
    /// Goes home.
    Park,
    /// Stands until cleared.
    Fault,
}

/// The state with what belongs to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Mode {
    pub state: State,
    /// Why it is not active, or will not be for long.
    pub cause: Cause,
    /// Meant only while stopping.
    pub after: AfterStop,
}

/// What a cycle found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Findings {
    /// Is the pose known, from good measurements? If not, why.
    pub located: Result<(), Cause>,
    /// May control begin? If not, why.
    pub engageable: Result<(), Cause>,
    /// Can the reference be followed on? If not, why. A cause that is no fault ends it in order.
    pub following: Result<(), Cause>,
    /// The reference of engaging, stopping or parking has come to its end.
    pub arrived: bool,
}

/// The next state, and why a request was refused if it was. `after_loss` is what follows the stop of a
/// platform that lost its setpoint.
pub fn next(
    mode: Mode,
    request: Option<Request>,
    findings: &Findings,
    after_loss: AfterStop,
) -> (Mode, Option<Cause>) {
    if request == Some(Request::Estop) {
        return (fault(Cause::EmergencyStop), None);
    }
    if mode.state.controls() {
        // Without the pose nothing can be controlled, whatever the reason.
        if let Err(cause) = findings.located {
            return (fault(cause), None);
        }
        if let Err(cause) = findings.following
            && cause.reaction() == Reaction::Brake
        {
            return (fault(cause), None);
        }
    }
    if request == Some(Request::Off) && mode.state != State::Fault {
        return (OFF_AS_ASKED, None);
    }
    match mode.state {
        State::Off | State::Standby => without_force(mode, request, findings),
        State::Fault => in_fault(mode, request),
        State::Engaging | State::Active => following(mode, request, findings, after_loss),
        State::Stopping => stopping(mode, request, findings),
        State::Parking => parking(mode, request, findings),
    }
}

/// Off because somebody wants it so: it does not become standby by itself.
const OFF_AS_ASKED: Mode = Mode { state: State::Off, cause: Cause::Asked, after: AfterStop::Standby };

fn fault(cause: Cause) -> Mode {
    Mode { state: State::Fault, cause, ..Mode::default() }
}

fn stop(cause: Cause, after: AfterStop) -> Mode {
    Mode { state: State::Stopping, cause, after }
}

fn standby(cause: Cause) -> Mode {
    Mode { state: State::Standby, cause, ..Mode::default() }
}

fn without_force(mode: Mode, request: Option<Request>, findings: &Findings) -> (Mode, Option<Cause>) {
    let ready = match findings.located {
        Ok(()) => standby(findings.engageable.err().unwrap_or(Cause::NotAsked)),
        Err(cause) => Mode { state: State::Off, cause, ..Mode::default() },
    };
    let rest = if mode == OFF_AS_ASKED { mode } else { ready };
    match request {
        Some(Request::Engage) => match findings.located.and(findings.engageable) {
            Ok(()) => (Mode { state: State::Engaging, ..Mode::default() }, None),
            Err(cause) => (rest, Some(cause)),
        },
        Some(Request::Clear) => (ready, None),
        // Home is a way to go without a setpoint.
        Some(Request::Park) => match findings.located {
            Ok(()) => (Mode { state: State::Parking, cause: Cause::Asked, ..Mode::default() }, None),
            Err(cause) => (rest, Some(cause)),
        },
        None | Some(Request::Stop | Request::Off | Request::Estop) => (rest, None),
    }
}

fn in_fault(mode: Mode, request: Option<Request>) -> (Mode, Option<Cause>) {
    match request {
        Some(Request::Clear) => (Mode::default(), None),
        Some(Request::Engage | Request::Park) => (mode, Some(Cause::NotNow)),
        Some(Request::Stop | Request::Off | Request::Estop) | None => (mode, None),
    }
}

fn following(
    mode: Mode,
    request: Option<Request>,
    findings: &Findings,
    after_loss: AfterStop,
) -> (Mode, Option<Cause>) {
    if let Err(cause) = findings.following {
        let after = match cause {
            Cause::SetpointLost => after_loss,
            cause if cause.is_fault() => AfterStop::Fault,
            _ => AfterStop::Standby,
        };
        return (stop(cause, after), None);
    }
    match request {
        Some(Request::Stop) => (stop(Cause::Asked, AfterStop::Standby), None),
        Some(Request::Park) => (stop(Cause::Asked, AfterStop::Park), None),
        Some(Request::Clear) => (mode, Some(Cause::NotNow)),
        Some(Request::Engage | Request::Off | Request::Estop) | None => {
            let state = if findings.arrived { State::Active } else { mode.state };
            (Mode { state, ..mode }, None)
        }
    }
}

fn stopping(mode: Mode, request: Option<Request>, findings: &Findings) -> (Mode, Option<Cause>) {
    let (mode, refused) = match (request, mode.after) {
        _ if findings.following.is_err() && mode.after != AfterStop::Fault => {
            (findings.following.map_or_else(|cause| stop(cause, AfterStop::Fault), |()| mode), None)
        }
        (Some(Request::Park), AfterStop::Standby) => (stop(Cause::Asked, AfterStop::Park), None),
        (Some(Request::Stop), AfterStop::Park) => (stop(Cause::Asked, AfterStop::Standby), None),
        (Some(Request::Engage | Request::Clear | Request::Park), _) => (mode, Some(Cause::NotNow)),
        _ => (mode, None),
    };
    if !findings.arrived {
        return (mode, refused);
    }
    let rest = match mode.after {
        AfterStop::Standby => standby(mode.cause),
        AfterStop::Park => Mode { state: State::Parking, cause: mode.cause, ..Mode::default() },
        AfterStop::Fault => fault(mode.cause),
    };
    (rest, refused)
}

fn parking(mode: Mode, request: Option<Request>, findings: &Findings) -> (Mode, Option<Cause>) {
    if let Err(cause) = findings.following {
        return (stop(cause, AfterStop::Fault), None);
    }
    match request {
        Some(Request::Stop) => return (stop(Cause::Asked, AfterStop::Standby), None),
        Some(Request::Engage | Request::Clear) => return (mode, Some(Cause::NotNow)),
        Some(Request::Park | Request::Off | Request::Estop) | None => {}
    }
    (if findings.arrived { OFF_AS_ASKED } else { mode }, None)
}
