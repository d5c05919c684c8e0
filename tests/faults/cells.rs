//! What becomes of a fault in a state, and what the platform may feel meanwhile.

use hexad::control::law::ControlMode;
use hexad::control::parameters::ViolationPolicy;
use hexad::control::signals::diagnostic::DiagnosticCode::{
    self, EmergencyStop, FeedbackSaturated, FollowingError, MeasurementImplausible, OperatorRequest,
    RateInconsistent, RateJumped, ReadyToEngage, SensorFrozen, SetpointBeyondLimits, SetpointTooFar,
    VelocityError,
};
use hexad::control::signals::state::State;

use super::disturbances::Disturbance;
use super::situations::Situation;
use hexad_support::rig::Rates;

/// What becomes of it.
#[derive(Clone, Copy, Debug)]
pub enum Cell {
    /// As if nothing had happened.
    On,
    /// Lets go at once, until cleared.
    Brake(DiagnosticCode),
    /// Stops under control, then lets go, until cleared.
    Stop(DiagnosticCode),
    /// Stops under control, then stands by.
    End(DiagnosticCode),
    /// Every state under control that is entered, and the first one without force.
    Path(&'static [(State, DiagnosticCode)]),
    /// Every state under control and every fault after the one that it began in, to the end; and the last state.
    Full(&'static [(State, DiagnosticCode)]),
    /// Without force all the time; in the end this.
    Idle(State, DiagnosticCode),
}

use Cell::{Brake, End, Full, Idle, On, Path, Stop};

impl Cell {
    /// The states that follow, as [`changes`] tells them.
    pub fn expected(self, situation: Situation) -> Vec<(State, DiagnosticCode)> {
        match self {
            On => match situation {
                Situation::Standby => vec![(State::Standby, ReadyToEngage)],
                Situation::Engaging => vec![(State::Active, DiagnosticCode::None)],
                Situation::AtRest | Situation::InMotion => vec![],
                Situation::Stopping => vec![(State::Standby, OperatorRequest)],
                Situation::Parking => vec![(State::Off, OperatorRequest)],
                Situation::Fault => vec![(State::Fault, EmergencyStop)],
            },
            Brake(cause) => vec![(State::Fault, cause)],
            Stop(cause) => vec![(State::Stopping, cause), (State::Fault, cause)],
            End(cause) => vec![(State::Stopping, cause), (State::Standby, cause)],
            Path(path) | Full(path) => path.into(),
            Idle(state, cause) => vec![(state, cause)],
        }
    }
}

/// Nothing after a request to switch off.
pub const OFF_TO_THE_END: Cell = Full(&[(State::Off, OperatorRequest)]);

/// What the platform may feel: shares of the limits of acceleration and jerk, and seconds until it stands.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub acceleration: f64,
    pub jerk: f64,
    pub rest_s: f64,
}

/// The limits of the deployment, which the reference keeps exactly; the platform is driven by forces that are held for a
/// period. At the speed of the scene brakes need 50 ms, a stop 100 ms; before it, up to 50 ms pass until a peer counts as
/// lost.
pub const GENTLE: Bounds = Bounds { acceleration: 1.015, jerk: 1.04, rest_s: 0.21 };
/// For those that begin a motion which ends later.
pub const LONG: Bounds = Bounds { rest_s: 1.6, ..GENTLE };
/// For a motion that ends in a stop most of a second later.
pub const LATE: Bounds = Bounds { rest_s: 0.8, ..GENTLE };
/// A tenth of a second of acceleration, the timeout, and the stop.
pub const ACCELERATED: Bounds = Bounds { rest_s: 0.4, ..GENTLE };
/// Brakes decelerate the platform until the first force arrives.
pub const OUT_OF_THE_BRAKES: Bounds = Bounds { acceleration: 1.06, jerk: 2.6, ..LONG };
pub const PARKED_OUT_OF_THE_BRAKES: Bounds = Bounds { jerk: 1.08, ..LONG };
/// Drives at the limit of their force: position and orientation are accelerated at once with all that is allowed.
pub const AT_FORCE_LIMIT: Bounds = Bounds { acceleration: 1.35, jerk: 1.3, ..LONG };
/// Without end.
pub const ENDLESS: Bounds = Bounds { rest_s: f64::INFINITY, ..GENTLE };
/// What hangs on the platform besides is pulled by feedback.
pub const PULLED: Bounds = Bounds { acceleration: 1.05, ..LONG };
/// After cycles that were missed the setpoint is followed in longer steps.
pub const MISSED: Bounds = Bounds { jerk: 1.4, ..LONG };
/// Within what is believed to be noise of an encoder.
pub const UNSEEN: Bounds = Bounds { acceleration: 1.03, jerk: 1.6, ..GENTLE };
/// By 1 g beside what the reference does.
pub const STRUCK: Bounds = Bounds { acceleration: 3.2, jerk: 23.0, ..LONG };
pub const SHAKEN: Bounds = Bounds { acceleration: 2.2, jerk: 6.4, rest_s: 1.4 };
/// A fifth of its weight, within a cycle.
pub const LOADED: Bounds = Bounds { acceleration: 1.1, jerk: 1.08, ..PULLED };
/// Ten times the weight of the platform: it falls.
pub const LOAD: Bounds = Bounds { acceleration: 10.8, jerk: 6.4, rest_s: 0.2 };

pub type Row = (&'static str, Disturbance, Bounds, [Cell; 7]);

/// Not finite, from another time, ...: the same in every state.
pub const fn unusable_measurement(cause: DiagnosticCode) -> [Cell; 7] {
    let brake = Brake(cause);
    [Idle(State::Off, cause), brake, brake, brake, brake, brake, On]
}

pub const fn unusable_setpoint(cause: DiagnosticCode) -> [Cell; 7] {
    [Idle(State::Standby, cause), Stop(cause), Stop(cause), Stop(cause), On, On, On]
}

/// Of setpoints that are wrong only in motion.
pub const fn wrong_in_motion(cause: DiagnosticCode) -> [Cell; 7] {
    [On, On, On, Stop(cause), On, On, On]
}

pub const EVERYWHERE: [Cell; 7] = [On; 7];
pub const TOO_FAR: Cell = Idle(State::Standby, SetpointTooFar);
pub const FULL_STOP: Cell = Brake(EmergencyStop);
pub const SWITCHED_OFF: Cell = Idle(State::Off, OperatorRequest);
pub const PARKS: Cell = Path(&[
    (State::Stopping, OperatorRequest),
    (State::Parking, OperatorRequest),
    (State::Off, OperatorRequest),
]);
pub const LATE_STOP: Cell = Path(&[
    (State::Active, DiagnosticCode::None),
    (State::Stopping, SetpointBeyondLimits),
    (State::Fault, SetpointBeyondLimits),
]);

/// A cell in a mode that knows less. Its causes and states are those of the table; where not, it is said here.
pub fn in_mode(
    policy: ViolationPolicy,
    mode: ControlMode,
    name: &str,
    situation: Situation,
    bounds: Bounds,
    cell: Cell,
) -> (Bounds, Cell) {
    use Situation::{AtRest, Engaging, InMotion, Parking, Stopping};
    let wider = |acceleration: f64, jerk: f64| Bounds {
        acceleration: bounds.acceleration.max(acceleration),
        jerk: bounds.jerk.max(jerk),
        ..bounds
    };
    let (is_gravity, is_pd) = (mode == ControlMode::GravityJointPd, mode == ControlMode::JointPd);
    let cell = cause_in_mode(mode, name, situation).unwrap_or(cell);
    match (name, situation) {
        // What is not noticed, feedback answers.
        ("a leg's length slips by 1 mm", InMotion | Stopping | Parking) if is_gravity || is_pd => {
            (wider(2.25, if is_pd { 6.3 } else { 3.0 }), cell)
        }
        ("a step of acceleration" | "daemon held for 5 ms", InMotion | Stopping) if is_gravity || is_pd => {
            (wider(1.61, if is_pd { 6.3 } else { 2.4 }), cell)
        }
        // Missing measurements are replaced by errors that vanish as the law wants it. Errors that hold up what the
        // model leaves out do not: force comes back with the next measurement.
        ("measurements pause for 10 ms", Engaging | InMotion | Stopping | Parking) if is_gravity => {
            (wider(1.87, 4.1), cell)
        }
        ("measurements pause for 10 ms", Stopping) if is_pd => (wider(1.9, 6.3), cell),
        ("one rate NaN, once" | "a leg's length jumps by 20 mm, once", _) if is_gravity => {
            (wider(1.5, 1.8), cell)
        }
        ("daemon held for 5 ms", Stopping) if mode.acts_on_legs() && !is_pd => (wider(1.02, 1.46), cell),
        ("off, and engage 3 ms later", Engaging | InMotion | Stopping) if is_pd => (bounds, OFF_TO_THE_END),
        ("off, and park 10 ms later" | "estop, then clear, and park 10 ms later", InMotion | Stopping)
            if is_gravity =>
        {
            (wider(1.5, 1.6), cell)
        }
        // It still sags, and nothing damps that.
        ("lengths and rates frozen", AtRest) if is_pd => {
            (Bounds { rest_s: f64::INFINITY, ..wider(1.5, 6.3) }, cell)
        }
        // By now it sags further from the setpoint than it may be.
        ("daemon restarted", Engaging) if is_pd => (bounds, TOO_FAR),
        // What the reference does with all that the limits allow, and on both sides of them.
        _ if policy == ViolationPolicy::Limit && (is_gravity || is_pd) => {
            let wider = wider(1.82, if is_pd { 6.3 } else { 2.0 });
            (Bounds { rest_s: if bounds.rest_s > 0.5 { f64::INFINITY } else { 0.4 }, ..wider }, cell)
        }
        // It falls by its sag when control begins, and further where an error that holds it up is not measured.
        _ if is_pd => (wider(1.5, 6.3), cell),
        // Inertia is left to feedback: the platform lags, and shoots over at the end of a stop with all that is allowed.
        _ if is_gravity => (wider(1.5, 1.3), cell),
        _ => (bounds, cell),
    }
}

/// What is noticed otherwise in a mode on legs: they are bounded one by one, more widely, and without the inertia in the model
/// more of a motion is plausible. Without one leg's force feedback is saturated, or the platform too far away, before its velocity
/// is wrong.
fn cause_in_mode(mode: ControlMode, name: &str, situation: Situation) -> Option<Cell> {
    use Situation::{AtRest, Engaging, Fault, InMotion, Parking, Standby, Stopping};
    if mode == ControlMode::ComputedTorque || matches!(situation, Standby | Fault) {
        return None;
    }
    const LASTING: Cell = Path(&[
        (State::Stopping, DiagnosticCode::Impact),
        (State::Fault, DiagnosticCode::DisturbanceLasting),
    ]);
    let is_pd = mode == ControlMode::JointPd;
    let cell = match (name, situation, mode.includes_inertia()) {
        // What accelerates the platform is known only where the model has its inertia.
        (
            "a load of a tenth of the platform"
            | "a load of a fifth of the platform"
            | "struck with 1 g for 10 ms",
            _,
            false,
        )
        | ("a drive shakes by a tenth at 30 Hz", InMotion | Stopping | Parking, false) => On,
        ("a drive shakes by a tenth at 30 Hz", InMotion, true) => Brake(DiagnosticCode::Oscillation),
        ("a drive shakes by a tenth at 30 Hz", Engaging, false) => {
            Path(&[(State::Active, DiagnosticCode::None), (State::Fault, DiagnosticCode::Oscillation)])
        }
        ("a leg without force", Engaging, true) => Brake(MeasurementImplausible),
        ("a leg without force", AtRest | Parking, false) if is_pd => Brake(FollowingError),
        ("a leg without force", AtRest | InMotion | Parking, false) => Brake(FeedbackSaturated),
        ("a leg without force", Engaging, false) if is_pd => {
            Path(&[(State::Active, DiagnosticCode::None), (State::Fault, FollowingError)])
        }
        ("a leg without force", Engaging, false) => {
            Path(&[(State::Active, DiagnosticCode::None), (State::Fault, FeedbackSaturated)])
        }
        ("a leg without force", Stopping, false) => On,
        ("the drives brake by themselves" | "the drives brake and setpoints end", Parking, true) => LASTING,
        ("the drives brake by themselves" | "the drives brake and setpoints end", Stopping, true) => {
            Path(&[(State::Stopping, DiagnosticCode::Impact), (State::Fault, MeasurementImplausible)])
        }
        ("the drives brake by themselves" | "the drives brake and setpoints end", Stopping, false) => {
            Brake(SensorFrozen)
        }
        ("the drives brake by themselves" | "the drives brake and setpoints end", InMotion, false) => {
            Brake(VelocityError)
        }
        ("the drives brake by themselves" | "the drives brake and setpoints end", Parking, false) => {
            Brake(SensorFrozen)
        }
        ("lengths and rates frozen", InMotion | Stopping | Parking, false) => Brake(SensorFrozen),
        ("a leg's length slips by 1 mm", InMotion | Stopping | Parking, false) => On,
        ("a load of ten platforms", _, false) => Brake(VelocityError),
        _ => return None,
    };
    Some(cell)
}

/// The cell of a driver that does not send rates, or not always: what is wrong with rates passes unseen, or is seen later; lengths
/// show the rest; and control does not begin anew in motion.
pub fn with_rates(
    rates: Rates,
    name: &str,
    situation: Situation,
    bounds: Bounds,
    cell: Cell,
) -> (Bounds, Cell) {
    use Situation::{AtRest, Engaging, Fault, InMotion, Parking, Standby, Stopping};
    let (is_always, is_never) = (rates == Rates::Always, rates == Rates::Never);
    match (name, situation, cell) {
        _ if is_always => (bounds, cell),
        ("rates infinite", ..) | ("rates zero", Parking, _) => (LONG, On),
        ("rates of the wrong sign" | "rates in mm/s" | "rates zero", _, Brake(RateJumped)) => {
            if is_never {
                (LONG, On)
            } else {
                (bounds, Brake(VelocityError))
            }
        }
        (_, _, Brake(RateJumped | RateInconsistent)) => (bounds, Brake(MeasurementImplausible)),
        (_, Standby | Fault, _) => (bounds, cell),
        // With rates in some measurements, one of those may come just in time.
        ("off, and engage 3 ms later", InMotion, _) => (bounds, OFF_TO_THE_END),
        ("off, and engage 3 ms later", ..) if is_never => (bounds, OFF_TO_THE_END),
        ("off, and park 10 ms later" | "estop, then clear, and park 10 ms later", AtRest, _) if !is_never => {
            (bounds, cell)
        }
        ("off, and park 10 ms later", ..) => (bounds, OFF_TO_THE_END),
        ("estop, then clear, and park 10 ms later", Engaging | AtRest, _) => {
            (bounds, Full(&[(State::Fault, EmergencyStop), (State::Standby, ReadyToEngage)]))
        }
        ("estop, then clear, and park 10 ms later", InMotion | Stopping | Parking, _) => {
            (bounds, Full(&[(State::Fault, EmergencyStop), (State::Standby, SetpointTooFar)]))
        }
        _ => (bounds, cell),
    }
}
