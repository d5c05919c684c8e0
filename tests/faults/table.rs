//! The table: every fault in every state, what the daemon does about it, and what the platform feels.
//!
//! Times are simulated, so nothing here depends on the host. With `HEXAD_FAULT_TABLE=FILE` the outcomes are
//! written as CSV; with `HEXAD_LONG=1` those of all cells, else of every fourth.

use std::fmt::Write;
use std::sync::LazyLock;

use hexad::control::law::ControlMode;
use hexad::control::parameters::ViolationPolicy;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::plant::simulator::Brakes;
use rayon::prelude::*;

use super::cells::{Bounds, Cell, LONG, Row, in_mode, with_rates};
use super::disturbances::{Disturbance, Moment};
use super::recording::Peaks;
use super::rows::{ROWS, ROWS_UNDER_LIMIT};
use super::situations::Situation;
use super::world::{Source, World};
use hexad_support::certificate;
use hexad_support::rig::Rates;

/// Cycles of each cell: a second for which the daemon may be held, and a stop after it; or the way home.
const CYCLES: u64 = 1600;

const POLICIES: [ViolationPolicy; 2] = [ViolationPolicy::Stop, ViolationPolicy::Limit];

/// What a cell came to.
struct Outcome {
    path: Vec<(State, DiagnosticCode)>,
    changes: Vec<(State, DiagnosticCode)>,
    last: (State, DiagnosticCode),
    peaks: Peaks,
    rest_s: Option<f64>,
    world: World,
}

/// A machine of the table: its policy, mode, and driver.
type Variant = (ViolationPolicy, ControlMode, Rates);

/// Every mode with rates, and one without them or with some.
fn variants() -> impl Iterator<Item = Variant> {
    let without = [Rates::Never, Rates::Sometimes].map(|rates| (ControlMode::default(), rates));
    let each = ControlMode::ALL.map(|mode| (mode, Rates::Always)).into_iter().chain(without);
    POLICIES.into_iter().flat_map(move |policy| each.clone().map(move |(mode, rates)| (policy, mode, rates)))
}

fn run(variant: Variant, situation: Situation, disturbance: Disturbance) -> Outcome {
    static WORLDS: LazyLock<Vec<(Variant, Vec<World>)>> = LazyLock::new(|| {
        let of = |variant @ (policy, mode, rates)| {
            // One by one: all together are too many for the stack of a thread.
            (variant, Situation::ALL.iter().map(|situation| situation.world(mode, policy, rates)).collect())
        };
        variants().map(of).collect()
    });
    let (_, worlds) = WORLDS.iter().find(|(found, _)| *found == variant).unwrap();
    let mut world = worlds[situation as usize].clone();
    let before = world.last;
    for cycle in 0..CYCLES {
        world.cycle(|world, input| disturbance(&mut Moment { world, input, before, cycle }));
    }
    let path = world.recording.path();
    Outcome {
        changes: changes(&path, situation),
        last: *path.last().unwrap(),
        path,
        peaks: world.recording.peaks(&world.parameters, world.machine.actuator.max_force_n),
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

/// Every state under control and every fault after the one that it began in, and the last state.
fn full(path: &[(State, DiagnosticCode)], situation: Situation) -> Vec<(State, DiagnosticCode)> {
    let rest = &path[usize::from(path[0] == situation.begins())..];
    let (last, before) = rest.split_last().unwrap();
    let counts = |(state, _): &&(State, DiagnosticCode)| state.has_control() || *state == State::Fault;
    before.iter().filter(counts).chain([last]).copied().collect()
}

/// Everything wrong with a cell.
fn complaints(
    policy: ViolationPolicy,
    cell: Cell,
    bounds: &Bounds,
    situation: Situation,
    outcome: &Outcome,
) -> Vec<String> {
    let mut wrong = Vec::new();
    let expected = cell.expected(situation);
    let is_idle =
        matches!(cell, Cell::Idle(..)) && !outcome.changes.iter().any(|(state, _)| state.has_control());
    let found = match cell {
        _ if is_idle => vec![outcome.last],
        Cell::Full(_) => full(&outcome.path, situation),
        _ => outcome.changes.clone(),
    };
    // Under "limit" a source that was near is followed, wherever it goes then.
    let becomes_active =
        policy == ViolationPolicy::Limit && situation == Situation::Engaging && expected.is_empty();
    if found != expected && !(becomes_active && found == [(State::Active, DiagnosticCode::None)]) {
        wrong.push(format!("{found:?} instead of {expected:?}"));
    }
    let Peaks { force, force_rate, acceleration, jerk, .. } = outcome.peaks;
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
    let follows = matches!(outcome.last.0, State::Active | State::Engaging);
    let moves_on =
        follows && matches!(outcome.world.source, Source::Plays(..)) || matches!(cell, Cell::Path([]));
    let at_most = if matches!(cell, Cell::On) { bounds.rest_s.max(LONG.rest_s) } else { bounds.rest_s };
    let rest_s = outcome.rest_s.unwrap_or(f64::INFINITY);
    if !moves_on && rest_s > at_most {
        wrong.push(format!("at rest after {rest_s} s, not {at_most}"));
    }
    let hit = matches!(outcome.world.rig.simulator().brakes(), Brakes::EndStop { .. });
    if hit {
        wrong.push("hit an end stop".into());
    }
    for sample in &outcome.world.recording.samples {
        let output = &sample.output;
        if !output.state.has_control() && output.command_n != [0.0; 6] {
            wrong.push(format!("a force in {:?}", output.state));
        }
        if output.state == State::Fault && !output.diagnostic.code.is_fault() {
            wrong.push(format!("a fault without one: {:?}", output.diagnostic.code));
        }
    }
    wrong
}

/// A row of the table on a machine.
type Case = (Variant, &'static Row, Situation);

fn cases() -> Vec<Case> {
    let mut cases = vec![];
    for variant @ (policy, ..) in variants() {
        let rows = if policy == ViolationPolicy::Stop { ROWS } else { ROWS_UNDER_LIMIT };
        cases.extend(rows.iter().flat_map(|row| Situation::ALL.map(|situation| (variant, row, situation))));
    }
    cases
}

#[test]
fn certificate_every_fault_in_every_state_does_what_the_table_says() {
    let cells = cases();
    assert!(cells.len() >= 2000);
    let cells = certificate::cases(cells, 4);
    let lines: Vec<_> = cells
        .par_iter()
        .map(|(variant @ (policy, mode, rates), (name, disturbance, bounds, expected), situation)| {
            let outcome = run(*variant, *situation, *disturbance);
            let expected = expected[*situation as usize];
            let (bounds, cell) = in_mode(*policy, *mode, name, *situation, *bounds, expected);
            let (bounds, cell) = with_rates(*rates, name, *situation, bounds, cell);
            let wrong = complaints(*policy, cell, &bounds, *situation, &outcome);
            let wrong: String = wrong
                .iter()
                .take(5)
                .map(|what| {
                    format!("\n  {policy:?}, {}, rates {rates:?}, {name}, {situation:?}: {what}", mode.name())
                })
                .collect();
            (csv_line(variant, name, *situation, &outcome), wrong)
        })
        .collect();
    if let Some(path) = std::env::var_os("HEXAD_FAULT_TABLE") {
        let rows: String = lines.iter().map(|(line, _)| line.as_str()).collect();
        std::fs::write(path, format!("{CSV_HEADER}{rows}")).unwrap();
    }
    let wrong: String = lines.into_iter().map(|(_, wrong)| wrong).collect();
    assert!(wrong.is_empty(), "{wrong}");
}

const CSV_HEADER: &str = "on_violation,mode,rates,fault,state,then,force_share,force_rate_share,acceleration_share,\
    jerk_share,at_rest_s\n";

fn csv_line((policy, mode, rates): &Variant, name: &str, situation: Situation, outcome: &Outcome) -> String {
    let then: Vec<_> =
        outcome.changes.iter().map(|(state, cause)| format!("{} ({})", state.name(), cause.name())).collect();
    let then = if then.is_empty() { "goes on".into() } else { then.join(" > ") };
    let Peaks { force, force_rate, acceleration, jerk, .. } = outcome.peaks;
    let policy = if *policy == ViolationPolicy::Stop { "stop" } else { "limit" };
    let mut line = format!("{policy},{},{rates:?},\"{name}\",{situation:?},\"{then}\"", mode.name());
    for share in [force, force_rate, acceleration, jerk] {
        write!(line, ",{share:.3}").unwrap();
    }
    writeln!(line, ",{}", outcome.rest_s.map_or_else(|| "moves".into(), |rest_s| format!("{rest_s:.3}")))
        .unwrap();
    line
}
