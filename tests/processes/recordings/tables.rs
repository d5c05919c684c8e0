//! A recorded run as a table is the input of the commands that read motions and lengths.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::{about, files};
use crate::support::children::Hexad;
use crate::support::machine::Machine;

const LOCKSTEP: &str = "[realtime]\nrelease = \"lockstep\"";

/// Columns of a table by name, each as text.
type Table = BTreeMap<String, Vec<String>>;

fn table(file: &Path) -> Table {
    let text = fs::read_to_string(file).unwrap();
    let mut lines = text.lines().map(|line| line.split(','));
    let header = lines.next().unwrap();
    let rows: Vec<Vec<&str>> = lines.map(Iterator::collect).collect();
    header
        .enumerate()
        .map(|(k, name)| (name.into(), rows.iter().map(|row| row[k].into()).collect()))
        .collect()
}

fn numbers(table: &Table, name: &str) -> Vec<f64> {
    table[name].iter().map(|number| number.parse().expect(name)).collect()
}

/// A machine of its own that plays a motion in lock-step from beginning to end, and the table of its recording.
fn recorded(motion: &[&str]) -> (Machine, PathBuf) {
    let machine = Machine::with("round-trip", LOCKSTEP);
    let folder = machine.path("record");
    let daemon = Hexad::start(&machine, "run", &["--record".as_ref(), folder.as_os_str()]);
    let plant = Hexad::start::<&str>(&machine, "plant", &[]);
    let source = Hexad::start(&machine, "move", &[motion, &["--engage"]].concat());
    source.ends().succeeds();
    daemon.says("standby: setpoint source ended at rest");
    plant.stops();
    daemon.stops();
    let file = machine.path("run.csv");
    about(&machine, "convert", &files(&machine, "record")[0], &["--csv", file.to_str().unwrap()]).succeeds();
    (machine, file)
}

/// A command that computes a table from a table.
fn computed(machine: &Machine, command: &str, input: &Path, more: &[&str]) -> Table {
    let output = machine.path("computed.csv");
    let files = ["--input", input.to_str().unwrap(), "--output", output.to_str().unwrap()];
    machine.hexad(command, &[&files, more].concat()).succeeds();
    table(&output)
}

/// Forces of a row \[N\].
fn forces(table: &Table, row: usize) -> [f64; 6] {
    core::array::from_fn(|k| table[&format!("drive_command_{}", k + 1)][row].parse().expect("a force"))
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The row in which the setpoints begin to move.
fn start(table: &Table) -> usize {
    numbers(table, "setpoint_x_rate").iter().position(|rate| rate.abs() > 0.0).expect("a motion")
}

/// At rest the recorded force is that of inverse dynamics but for rounding. In motion it is held for a cycle, at whose ends are the
/// references: their mean force differs by the feedback and by what is not linear within a cycle, 5e-3 N in this motion.
const AT_REST_N: f64 = 1e-9;
const IN_MOTION_N: f64 = 0.02;

/// A setpoint that was rounded differs by 2e-16; divided by the squared period that is 2e-10 of the acceleration.
const AGAIN_N: f64 = 1e-7;

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_recorded_run_is_computed_and_played_again_from_its_table() {
    let (machine, file) = recorded(&["--motion", "sines", "--seconds", "1"]);
    let first = table(&file);
    let begin = start(&first);
    let moving = begin..begin + 1000;
    assert!(first["state"][begin - 100..moving.end].iter().all(|state| state == "active"));
    assert!(first["setpoint_kind"][begin] == "motion");

    let of_setpoints = computed(&machine, "inverse-dynamics", &file, &[]);
    let row_at = |table: &Table, t: &str| table["t"].iter().position(|found| found == t).expect("its row");
    for row in begin - 100..begin {
        let computed = forces(&of_setpoints, row_at(&of_setpoints, &first["setpoint_t"][row]));
        let difference = largest_difference(&forces(&first, row), &computed);
        assert!(difference < AT_REST_N, "row {row}: {difference} N");
    }

    let of_references = computed(&machine, "inverse-dynamics", &file, &["--group", "reference"]);
    let first_row = row_at(&of_references, &first["reference_t"][begin]);
    for row in moving.clone() {
        let end = first_row + row - begin;
        let [before, after] = [end - 1, end].map(|row| forces(&of_references, row));
        let mean: [f64; 6] = core::array::from_fn(|k| 0.5 * (before[k] + after[k]));
        let difference = largest_difference(&forces(&first, row), &mean);
        assert!(difference < IN_MOTION_N, "row {row}: {difference} N");
    }

    let found = computed(&machine, "forward-kinematics", &file, &[]);
    let difference = largest_difference(&numbers(&found, "x"), &numbers(&first, "estimated_x"));
    assert!(difference < 1e-9, "{difference} m");

    let (_machine, file) = recorded(&["--trajectory", file.to_str().unwrap()]);
    let second = table(&file);
    let again = start(&second);
    for row in moving {
        let difference = largest_difference(&forces(&first, row), &forces(&second, again + row - begin));
        assert!(difference < AGAIN_N, "row {row}: {difference} N");
    }
}
