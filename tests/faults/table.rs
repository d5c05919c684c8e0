//! The table: every fault in every state, what the daemon does about it, and what the platform feels.
//!
//! Times are simulated, so nothing here depends on the host. With `HEXAD_FAULT_TABLE=FILE` the outcomes are
//! written as CSV.

use std::fmt::Write;
use std::sync::LazyLock;

use hexad::control::diagnostic::DiagnosticCode::{
    self, DeadlineMissed, EmergencyStop, FollowingError, LengthOutOfStroke, MeasurementJumped,
    MeasurementLost, MeasurementNotFinite, MeasurementStampInvalid, OperatorRequest, RateInconsistent,
    RateJumped, ReadyToEngage, SetpointBeyondLimits, SetpointEnded, SetpointJumped, SetpointLost,
    SetpointNotFinite, SetpointOutOfEnvelope, SetpointOutOfReach, SetpointStampInvalid, SetpointTooFar,
    SetpointTooFast,
};
use hexad::control::law::ControlMode;
use hexad::control::state::State;
use hexad::plant::simulator::Brakes;
use rayon::prelude::*;

use super::disturbances::{Disturbance, Moment, host, machine, measurements, operator, setpoints, together};
use super::recording::Peaks;
use super::situations::Situation;
use super::world::World;

/// Cycles of each cell: a second for which the daemon may be held, and a stop after it; or the way home.
const CYCLES: u64 = 1600;

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
    /// The same, and the platform hits an end stop.
    Overrun(&'static [(State, DiagnosticCode)]),
    /// Without force all the time; in the end this.
    Idle(State, DiagnosticCode),
    /// Nothing in the messages tells it from a platform that stands: it is driven to its end stops. What
    /// guards against it are drives that check their own encoders.
    Unseen,
}

use Cell::{Brake, End, Idle, On, Overrun, Path, Stop, Unseen};

impl Cell {
    /// The states that follow, as [`changes`] tells them.
    fn expected(self, situation: Situation) -> Vec<(State, DiagnosticCode)> {
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
            Path(path) | Overrun(path) => path.into(),
            Idle(state, cause) => vec![(state, cause)],
            Unseen => vec![(State::Active, DiagnosticCode::None)],
        }
    }
}

/// What the platform may feel: shares of the limits of acceleration and jerk, and seconds until it stands.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    acceleration: f64,
    jerk: f64,
    rest_s: f64,
}

/// The limits of the deployment, which the reference keeps exactly; the platform is driven by forces that are held for a
/// period. At the speed of the scene brakes need 50 ms, a stop 140 ms; before it, up to 50 ms pass until a peer counts as
/// lost.
const GENTLE: Bounds = Bounds { acceleration: 1.015, jerk: 1.025, rest_s: 0.2 };
/// For those that begin a motion which ends later.
const LONG: Bounds = Bounds { rest_s: 1.6, ..GENTLE };
/// A thirtieth of a second without news: what the setpoint did meanwhile comes at once.
const GAP: Bounds = Bounds { jerk: 1.1, ..GENTLE };
/// Setpoints at a tenth of the rate make steps of acceleration, and steps of position by jitter.
const COARSE: Bounds = Bounds { jerk: 1.6, ..GENTLE };
/// Within what is believed to be noise of an encoder.
const UNSEEN: Bounds = Bounds { jerk: 1.7, ..GENTLE };
/// A lie of the sensors works until it has made a difference that can be seen.
const LIE: Bounds = Bounds { acceleration: 3.3, jerk: 4.1, rest_s: 0.2 };
/// The same, and where nothing can be seen the impact on an end stop.
const FROZEN: Bounds = Bounds { jerk: 5.2, rest_s: 0.75, ..LIE };
/// Ten times the weight of the platform: it falls.
const LOAD: Bounds = Bounds { acceleration: 11.0, jerk: 6.5, rest_s: 0.2 };

type Row = (&'static str, Disturbance, Bounds, [Cell; 7]);

/// Not finite, from another time, ...: the same in every state.
const fn unusable_measurement(cause: DiagnosticCode) -> [Cell; 7] {
    let brake = Brake(cause);
    [Idle(State::Off, cause), brake, brake, brake, brake, brake, On]
}

const fn unusable_setpoint(cause: DiagnosticCode) -> [Cell; 7] {
    [Idle(State::Standby, cause), Stop(cause), Stop(cause), Stop(cause), On, On, On]
}

/// Of setpoints that are wrong only in motion.
const fn wrong_in_motion(cause: DiagnosticCode) -> [Cell; 7] {
    [On, On, On, Stop(cause), On, On, On]
}

const EVERYWHERE: [Cell; 7] = [On; 7];
const TOO_FAR: Cell = Idle(State::Standby, SetpointTooFar);
const FULL_STOP: Cell = Brake(EmergencyStop);
const SWITCHED_OFF: Cell = Idle(State::Off, OperatorRequest);
const PARKS: Cell = Path(&[
    (State::Stopping, OperatorRequest),
    (State::Parking, OperatorRequest),
    (State::Off, OperatorRequest),
]);
const OUT_OF_REACH: [(State, DiagnosticCode); 3] = [
    (State::Active, DiagnosticCode::None),
    (State::Stopping, SetpointBeyondLimits),
    (State::Fault, SetpointBeyondLimits),
];
const LATE_STOP: Cell = Path(&OUT_OF_REACH);

/// A cell in a mode that knows less. Its causes and states are those of the table; where not, it is said here.
fn in_mode(
    mode: ControlMode,
    name: &str,
    situation: Situation,
    bounds: Bounds,
    cell: Cell,
) -> (Bounds, Cell) {
    use Situation::{AtRest, Engaging, InMotion, Stopping};
    let wider = |acceleration: f64, jerk: f64| Bounds {
        acceleration: bounds.acceleration.max(acceleration),
        jerk: bounds.jerk.max(jerk),
        ..bounds
    };
    let (is_gravity, is_pd) = (mode == ControlMode::GravityJointPd, mode == ControlMode::JointPd);
    match (name, situation) {
        // Missing measurements are replaced by errors that vanish as the law wants it. Errors that hold up what the
        // model leaves out do not: force comes back with the next measurement.
        ("measurements pause for 10 ms", Engaging | InMotion | Stopping) if is_gravity => {
            (wider(0.0, 4.1), cell)
        }
        ("setpoints end, then measurements", Stopping) if is_gravity => (wider(0.0, 1.2), cell),
        ("lengths and rates frozen", Engaging) if is_gravity => (wider(0.0, 6.0), cell),
        // The reference comes to rest within the stroke. The platform is beside it by a millimetre, and overruns.
        ("smoothly to the end of the stroke", Engaging) if is_gravity => {
            (wider(1.1, 4.1), Overrun(&OUT_OF_REACH))
        }
        ("smoothly to the end of the stroke", AtRest | InMotion) if is_gravity => {
            (wider(1.1, 4.1), Overrun(&OUT_OF_REACH[1..]))
        }
        // It still sags, so it moves: seen at last.
        ("lengths and rates frozen", Engaging) if is_pd => (
            wider(1.4, 6.3),
            Path(&[(State::Active, DiagnosticCode::None), (State::Fault, RateInconsistent)]),
        ),
        // It still sags, and nothing damps that.
        ("lengths and rates frozen" | "rates zero", AtRest) if is_pd => {
            (Bounds { rest_s: f64::INFINITY, ..wider(1.4, 6.3) }, cell)
        }
        // By now it sags further from the setpoint than it may be.
        ("daemon restarted", Engaging) if is_pd => (bounds, TOO_FAR),
        // It falls by its sag when control begins, and further where an error that holds it up is not measured.
        _ if is_pd => (wider(1.4, 6.3), cell),
        _ => (bounds, cell),
    }
}

/// In the columns: standby, engaging, active at rest, active in motion, stopping, parking, fault.
#[rustfmt::skip]
const ROWS: &[Row] = &[
    ("nothing", |_| {}, LONG, EVERYWHERE),
    // Measurements.
    ("measurements end", measurements::end, GENTLE, unusable_measurement(MeasurementLost)),
    ("measurements pause for 10 ms", measurements::pause_10_ms, LONG, EVERYWHERE),
    ("measurements pause for 30 ms", measurements::pause_30_ms, GENTLE, [On, Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), On]),
    ("lengths NaN", measurements::nan_length, GENTLE, unusable_measurement(MeasurementNotFinite)),
    ("one rate NaN, once", measurements::nan_rate_once, LONG, EVERYWHERE),
    ("rates infinite", measurements::infinite_rate, GENTLE, unusable_measurement(MeasurementNotFinite)),
    ("a leg's length jumps by 20 mm", measurements::jump_20_mm, GENTLE, [TOO_FAR, Brake(MeasurementJumped), Brake(MeasurementJumped), Brake(MeasurementJumped), Brake(MeasurementJumped), Brake(MeasurementJumped), On]),
    ("a leg's length jumps by 20 mm, once", measurements::jump_20_mm_once, LONG, EVERYWHERE),
    ("a leg's length slips by 1 mm", measurements::slip_1_mm, UNSEEN, [On, Brake(RateInconsistent), Brake(RateInconsistent), On, On, Brake(RateInconsistent), On]),
    ("lengths and rates frozen", measurements::freeze, FROZEN, [On, Unseen, On, Brake(RateInconsistent), Brake(RateInconsistent), Brake(RateInconsistent), On]),
    ("a length beyond the stroke", measurements::out_of_stroke, GENTLE, unusable_measurement(LengthOutOfStroke)),
    ("rates of the wrong sign", measurements::rates_of_wrong_sign, Bounds { rest_s: 0.7, ..LIE }, [On, Brake(RateInconsistent), Brake(RateInconsistent), Brake(RateJumped), Brake(RateJumped), Brake(RateInconsistent), On]),
    ("rates in mm/s", measurements::rates_in_mm, LIE, [On, Brake(RateJumped), Brake(RateJumped), Brake(RateJumped), Brake(RateJumped), Brake(RateJumped), On]),
    ("rates zero", measurements::rates_zero, Bounds { rest_s: 0.5, ..LIE }, [On, Brake(RateInconsistent), On, Brake(RateJumped), Brake(RateJumped), Brake(RateInconsistent), On]),
    ("measurements stamped 1 s ago", measurements::stamps_1_s_old, GENTLE, unusable_measurement(MeasurementStampInvalid)),
    ("measurements stamped 1 s ahead", measurements::stamps_1_s_ahead, GENTLE, unusable_measurement(MeasurementStampInvalid)),
    ("measurements stamped 0", measurements::stamps_of_nothing, GENTLE, unusable_measurement(MeasurementStampInvalid)),
    ("measurements' stamps run backward", measurements::stamps_run_backward, GENTLE, unusable_measurement(MeasurementStampInvalid)),
    ("counts of 1 um, noise of 1 mm/s", measurements::noise_of_encoders, Bounds { rest_s: f64::INFINITY, ..GENTLE }, EVERYWHERE),
    ("rates filtered with 5 ms", measurements::filtered_rates, LONG, EVERYWHERE),
    // Setpoints.
    ("setpoints end", setpoints::end, GENTLE, [Idle(State::Standby, SetpointEnded), End(SetpointEnded), End(SetpointEnded), Stop(SetpointLost), On, On, On]),
    ("setpoints pause for 30 ms", setpoints::pause_30_ms, Bounds { rest_s: 1.6, ..GAP }, EVERYWHERE),
    ("setpoints repeated with fresh stamps", setpoints::freeze, GENTLE, wrong_in_motion(SetpointBeyondLimits)),
    ("X NaN", setpoints::nan_x, GENTLE, unusable_setpoint(SetpointNotFinite)),
    ("X NaN, once", setpoints::nan_x_once, LONG, EVERYWHERE),
    ("X'' infinite", setpoints::infinite_xdd, GENTLE, unusable_setpoint(SetpointNotFinite)),
    ("X jumps by 10 mm", setpoints::jump_10_mm, GENTLE, [TOO_FAR, Stop(SetpointJumped), Stop(SetpointJumped), Stop(SetpointJumped), On, On, On]),
    ("X jumps by 10 mm, once", setpoints::jump_10_mm_once, LONG, EVERYWHERE),
    ("X, X', X'' zero", setpoints::all_zero, GENTLE, unusable_setpoint(SetpointOutOfEnvelope)),
    ("X' zero", setpoints::without_rates, GENTLE, wrong_in_motion(SetpointJumped)),
    ("X' in mm/s", setpoints::rates_in_mm, GENTLE, wrong_in_motion(SetpointTooFast)),
    ("X' of the wrong sign", setpoints::rates_of_wrong_sign, GENTLE, wrong_in_motion(SetpointJumped)),
    ("X' of another motion", setpoints::rate_while_standing, GENTLE, [TOO_FAR, Stop(SetpointJumped), Stop(SetpointJumped), Stop(SetpointJumped), On, On, On]),
    ("X'' zero", setpoints::without_accelerations, LONG, EVERYWHERE),
    ("X'' of another motion", setpoints::acceleration_while_standing, LONG, EVERYWHERE),
    ("too fast", setpoints::too_fast, GENTLE, unusable_setpoint(SetpointTooFast)),
    ("too strong an acceleration", setpoints::too_strong, GENTLE, unusable_setpoint(SetpointTooFast)),
    ("a step of acceleration", setpoints::step_of_acceleration, GENTLE, [Idle(State::Standby, SetpointTooFast), Stop(SetpointTooFast), Stop(SetpointTooFast), Stop(SetpointTooFast), On, On, On]),
    ("smoothly to the end of the stroke", setpoints::run_out_of_stroke, LONG, [Idle(State::Standby, SetpointOutOfReach), LATE_STOP, Stop(SetpointBeyondLimits), Stop(SetpointBeyondLimits), On, On, On]),
    ("beyond the stroke", setpoints::beyond_stroke, GENTLE, unusable_setpoint(SetpointOutOfReach)),
    ("out of the envelope", setpoints::out_of_envelope, GENTLE, unusable_setpoint(SetpointOutOfEnvelope)),
    ("setpoints stamped 1 s ago", setpoints::stamps_1_s_old, GENTLE, unusable_setpoint(SetpointStampInvalid)),
    ("setpoints stamped 1 s ahead", setpoints::stamps_1_s_ahead, GENTLE, unusable_setpoint(SetpointStampInvalid)),
    ("setpoints' stamps run backward", setpoints::stamps_run_backward, GENTLE, unusable_setpoint(SetpointStampInvalid)),
    ("two sources at once", setpoints::second_source, LONG, [TOO_FAR, On, On, On, On, On, On]),
    ("100 Hz, stamps off by 0.2 ms", setpoints::slow_and_jittery, Bounds { rest_s: 1.6, ..COARSE }, EVERYWHERE),
    // The operator.
    ("estop", operator::estop, GENTLE, [FULL_STOP; 7]),
    ("off", operator::off, GENTLE, [SWITCHED_OFF, SWITCHED_OFF, SWITCHED_OFF, SWITCHED_OFF, SWITCHED_OFF, SWITCHED_OFF, On]),
    ("stop", operator::stop, GENTLE, [On, End(OperatorRequest), End(OperatorRequest), End(OperatorRequest), On, End(OperatorRequest), On]),
    ("park", operator::park, LONG, [Path(&[(State::Parking, OperatorRequest), (State::Off, OperatorRequest)]), PARKS, PARKS, PARKS, Path(&[(State::Parking, OperatorRequest), (State::Off, OperatorRequest)]), On, On]),
    ("clear", operator::clear, LONG, [On, On, On, On, On, On, TOO_FAR]),
    ("engage", operator::engage, LONG, [Path(&[(State::Engaging, DiagnosticCode::None), (State::Active, DiagnosticCode::None)]), On, On, On, On, On, On]),
    ("engage far away", operator::engage_far_away, GENTLE, [TOO_FAR, Stop(SetpointJumped), Stop(SetpointJumped), On, On, On, On]),
    // The machine.
    ("collision", machine::collision, GENTLE, [On, On, On, Brake(RateJumped), Brake(RateJumped), Brake(FollowingError), On]),
    ("the drives brake by themselves", machine::braked, GENTLE, [On, On, On, Brake(FollowingError), On, Brake(FollowingError), On]),
    ("a leg without force", machine::leg_without_force, Bounds { rest_s: 0.25, ..GENTLE }, [On, Path(&[(State::Active, DiagnosticCode::None), (State::Fault, FollowingError)]), Brake(FollowingError), Brake(FollowingError), On, Brake(FollowingError), On]),
    ("a load of a tenth of the platform", machine::load_of_a_tenth, LONG, EVERYWHERE),
    ("a load of ten platforms", machine::load_of_ten, LOAD, [On, Brake(FollowingError), Brake(FollowingError), Brake(FollowingError), Brake(FollowingError), Brake(FollowingError), On]),
    // The host.
    ("deadline missed", host::deadline_missed, GENTLE, [On, Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed), On]),
    ("daemon held for 1 s", host::held_1_s, GENTLE, [On, Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), On]),
    ("daemon held for 5 ms", host::held_5_ms, LONG, EVERYWHERE),
    ("daemon restarted", host::restarted, GENTLE, [On, Idle(State::Standby, ReadyToEngage), Idle(State::Standby, ReadyToEngage), TOO_FAR, TOO_FAR, TOO_FAR, TOO_FAR]),
    // Two at once.
    ("setpoints end, then measurements", together::setpoint_ends_then_measurement, GENTLE, [Idle(State::Off, MeasurementLost), End(SetpointEnded), End(SetpointEnded), Path(&[(State::Stopping, SetpointLost), (State::Fault, MeasurementLost)]), Brake(MeasurementLost), Brake(MeasurementLost), On]),
    ("both end", together::both_end, GENTLE, unusable_measurement(MeasurementLost)),
    ("NaN in both", together::nan_in_both, GENTLE, unusable_measurement(MeasurementNotFinite)),
    ("X jumps and a deadline is missed", together::setpoint_jumps_and_deadline_missed, GENTLE, [TOO_FAR, Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed), On]),
    ("estop without measurements", together::estop_without_measurement, GENTLE, [FULL_STOP; 7]),
    ("off without measurements", together::off_without_measurement, GENTLE, [SWITCHED_OFF, Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost), On]),
    ("collision and setpoints end", together::collision_and_setpoint_ends, GENTLE, [Idle(State::Standby, SetpointEnded), End(SetpointEnded), End(SetpointEnded), Brake(RateJumped), Brake(RateJumped), Brake(FollowingError), On]),
    ("the drives brake and setpoints end", together::braked_and_setpoint_ends, GENTLE, [Idle(State::Standby, SetpointEnded), End(SetpointEnded), End(SetpointEnded), Path(&[(State::Stopping, SetpointLost), (State::Fault, FollowingError)]), On, Brake(FollowingError), On]),
    ("stop every 10 ms", together::stop_every_10_ms, GENTLE, [On, End(OperatorRequest), End(OperatorRequest), End(OperatorRequest), On, End(OperatorRequest), On]),
    ("estop, then engage", together::estop_then_engage, GENTLE, [FULL_STOP; 7]),
];

/// What a cell came to.
struct Outcome {
    changes: Vec<(State, DiagnosticCode)>,
    last: (State, DiagnosticCode),
    peaks: Peaks,
    rest_s: Option<f64>,
    world: World,
}

fn run(mode: ControlMode, situation: Situation, disturbance: Disturbance) -> Outcome {
    static WORLDS: LazyLock<Vec<[World; 7]>> = LazyLock::new(|| {
        let of = |mode| Situation::ALL.map(|situation| situation.world(mode));
        ControlMode::ALL.into_iter().map(of).collect()
    });
    let mut world = WORLDS[mode as usize][situation as usize].clone();
    let before = world.last;
    for cycle in 0..CYCLES {
        world.cycle(|world, input| disturbance(&mut Moment { world, input, before, cycle }));
    }
    let path = world.recording.path();
    Outcome {
        changes: changes(&path, situation),
        last: *path.last().unwrap(),
        peaks: world.recording.peaks(&world.parameters, world.machine.actuator.max_force),
        rest_s: world.recording.time_to_rest(),
        world,
    }
}

/// From a state under control: what follows it, to the first state without force. From one without: the
/// same once control has begun; if it never does, the end.
fn changes(path: &[(State, DiagnosticCode)], situation: Situation) -> Vec<(State, DiagnosticCode)> {
    let controls = |(state, _): &(State, DiagnosticCode)| state.has_control();
    let begin = match situation.state().has_control() {
        true => usize::from(path[0] == situation.begins()),
        false => path.iter().position(controls).unwrap_or(path.len() - 1),
    };
    let end = begin + path[begin..].iter().take_while(|at| controls(at)).count();
    path[begin..path.len().min(end + 1)].into()
}

/// Everything wrong with a cell.
fn complaints(cell: Cell, bounds: &Bounds, situation: Situation, outcome: &Outcome) -> Vec<String> {
    let mut wrong = Vec::new();
    let expected = cell.expected(situation);
    let is_idle = matches!(cell, Idle(..)) && !outcome.changes.iter().any(|(state, _)| state.has_control());
    let found = if is_idle { vec![outcome.last] } else { outcome.changes.clone() };
    if found != expected {
        wrong.push(format!("{found:?} instead of {expected:?}"));
    }
    let Peaks { force, force_rate, acceleration, jerk } = outcome.peaks;
    for (what, share, bound) in [
        ("force", force, 1.0),
        ("force rate", force_rate, 1.0 + 1e-9),
        ("acceleration", acceleration, bounds.acceleration),
        ("jerk", jerk, bounds.jerk),
    ] {
        if !(share <= bound) {
            wrong.push(format!("{what} of {share:.3} times the limit, beyond {bound}"));
        }
    }
    let moves_on = outcome.last.0 == State::Active && situation == Situation::InMotion;
    let at_most = if matches!(cell, On) { bounds.rest_s.max(LONG.rest_s) } else { bounds.rest_s };
    let rest_s = outcome.rest_s.unwrap_or(f64::INFINITY);
    if !moves_on && rest_s > at_most {
        wrong.push(format!("at rest after {rest_s} s, not {at_most}"));
    }
    let hit = matches!(outcome.world.rig.simulator.brakes(), Brakes::EndStop { .. });
    if hit != matches!(cell, Unseen | Overrun(_)) {
        wrong.push(format!("hit an end stop: {hit}"));
    }
    for sample in &outcome.world.recording.samples {
        let output = &sample.output;
        if !output.state.has_control() && output.force != [0.0; 6] {
            wrong.push(format!("a force in {:?}", output.state));
        }
        if output.state == State::Fault && !output.diagnostic.code.is_fault() {
            wrong.push(format!("a fault without one: {:?}", output.diagnostic.code));
        }
    }
    wrong
}

#[test]
fn every_fault_in_every_state_does_what_the_table_says() {
    let cells: Vec<_> = ControlMode::ALL
        .into_iter()
        .flat_map(|mode| ROWS.iter().map(move |row| (mode, row)))
        .flat_map(|(mode, row)| Situation::ALL.into_iter().map(move |situation| (mode, row, situation)))
        .collect();
    assert!(cells.len() >= 600);
    let lines: Vec<_> = cells
        .par_iter()
        .map(|(mode, (name, disturbance, bounds, expected), situation)| {
            let outcome = run(*mode, *situation, *disturbance);
            let (bounds, cell) = in_mode(*mode, name, *situation, *bounds, expected[*situation as usize]);
            let wrong = complaints(cell, &bounds, *situation, &outcome);
            let wrong: String = wrong
                .iter()
                .take(5)
                .map(|what| format!("\n  {}, {name}, {situation:?}: {what}", mode.name()))
                .collect();
            (csv_line(*mode, name, *situation, &outcome), wrong)
        })
        .collect();
    if let Some(path) = std::env::var_os("HEXAD_FAULT_TABLE") {
        let rows: String = lines.iter().map(|(line, _)| line.as_str()).collect();
        std::fs::write(path, format!("{CSV_HEADER}{rows}")).unwrap();
    }
    let wrong: String = lines.into_iter().map(|(_, wrong)| wrong).collect();
    assert!(wrong.is_empty(), "{wrong}");
}

const CSV_HEADER: &str =
    "mode,fault,state,then,force_share,force_rate_share,acceleration_share,jerk_share,at_rest_s\n";

fn csv_line(mode: ControlMode, name: &str, situation: Situation, outcome: &Outcome) -> String {
    let then: Vec<_> =
        outcome.changes.iter().map(|(state, cause)| format!("{} ({})", state.name(), cause.name())).collect();
    let then = if then.is_empty() { "goes on".into() } else { then.join(" > ") };
    let Peaks { force, force_rate, acceleration, jerk } = outcome.peaks;
    let mut line = format!("{},\"{name}\",{situation:?},\"{then}\"", mode.name());
    for share in [force, force_rate, acceleration, jerk] {
        write!(line, ",{share:.3}").unwrap();
    }
    writeln!(line, ",{}", outcome.rest_s.map_or_else(|| "moves".into(), |rest_s| format!("{rest_s:.3}")))
        .unwrap();
    line
}
