//! A recorded run as a table is the input of the commands that read motions and lengths.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::{about, files};
use crate::support::children::{Ended, HANG, Hexad, run};
use crate::support::machine::Machine;
use crate::support::turns;

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
    let ended = source.ends_within(HANG);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    daemon.says("standby: setpoint source ended at rest");
    plant.stops_on("TERM", HANG);
    daemon.stops_on("TERM", HANG);
    let file = machine.path("run.csv");
    let ended = about(&machine, "convert", &files(&machine, "record")[0], &["--csv", file.to_str().unwrap()]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    (machine, file)
}

/// A command that computes a table from a table.
fn computed(machine: &Machine, command: &str, input: &Path, more: &[&str]) -> (Ended, PathBuf) {
    let output = machine.path("computed.csv");
    let [config, input, to] = [&machine.file, input, &output].map(|path| path.to_str().unwrap());
    let files = [command, "--config", config, "--input", input, "--output", to];
    (run(machine, &[&files, more].concat()), output)
}

/// Forces of a row \[N\].
fn forces(table: &Table, row: usize) -> [f64; 6] {
    core::array::from_fn(|k| table[&format!("force_{}", k + 1)][row].parse().expect("a force"))
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
fn a_recorded_run_is_computed_and_played_again_from_its_table() {
    let _turn = turns::beside_others();
    let (machine, file) = recorded(&["--motion", "sines", "--seconds", "1"]);
    let first = table(&file);
    let begin = start(&first);
    let moving = begin..begin + 1000;
    assert!(first["state"][begin - 100..moving.end].iter().all(|state| state == "active"));
    assert!(first["setpoint_kind"][begin] == "motion");

    let (ended, output) = computed(&machine, "inverse-dynamics", &file, &[]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    let of_setpoints = table(&output);
    let row_at = |table: &Table, t: &str| table["t"].iter().position(|found| found == t).expect("its row");
    for row in begin - 100..begin {
        let computed = forces(&of_setpoints, row_at(&of_setpoints, &first["setpoint_t"][row]));
        let difference = largest_difference(&forces(&first, row), &computed);
        assert!(difference < AT_REST_N, "row {row}: {difference} N");
    }

    let (ended, output) = computed(&machine, "inverse-dynamics", &file, &["--group", "reference"]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    let of_references = table(&output);
    let first_row = row_at(&of_references, &first["reference_t"][begin]);
    for row in moving.clone() {
        let end = first_row + row - begin;
        let [before, after] = [end - 1, end].map(|row| forces(&of_references, row));
        let mean: [f64; 6] = core::array::from_fn(|k| 0.5 * (before[k] + after[k]));
        let difference = largest_difference(&forces(&first, row), &mean);
        assert!(difference < IN_MOTION_N, "row {row}: {difference} N");
    }

    let (ended, output) = computed(&machine, "forward-kinematics", &file, &[]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    let difference = largest_difference(&numbers(&table(&output), "x"), &numbers(&first, "estimated_x"));
    assert!(difference < 1e-9, "{difference} m");

    let (_machine, file) = recorded(&["--trajectory", file.to_str().unwrap()]);
    let second = table(&file);
    let again = start(&second);
    for row in moving {
        let difference = largest_difference(&forces(&first, row), &forces(&second, again + row - begin));
        assert!(difference < AGAIN_N, "row {row}: {difference} N");
    }
}

#[test]
fn a_group_that_is_not_there_and_former_names_are_refused() {
    let machine = Machine::patient("groups");
    let axes = ["alpha", "beta", "gamma", "x", "y", "z"];
    let of = |group: &str| format!("{group}_t,{}", axes.map(|axis| format!("{group}_{axis}")).join(","));
    let zeros = |count: usize| vec!["0"; count].join(",");
    let [estimated, reference] = ["estimated", "reference"].map(of);
    let gap = format!(
        "{}\n{}\n{nan}\n{nan}\n1,{}\n",
        of("setpoint"),
        zeros(7),
        zeros(6),
        nan = ["NaN"; 7].join(",")
    );
    for (text, group, words) in [
        (
            format!("{estimated},{reference}\n{}\n", zeros(14)),
            None,
            "line 1: columns of several groups: --group must name one of reference, estimated",
        ),
        (
            format!("{estimated}\n{}\n", zeros(7)),
            Some("measured"),
            "line 1: missing column measured_t: groups with all columns: estimated",
        ),
        (gap, None, "line 3: no setpoint up to line 5: must be without a gap"),
        (
            "t,setpoint_x_1\n0,0\n".into(),
            None,
            "setpoint_x_1 is now setpoint_alpha: convert the recording again",
        ),
        (
            "t,setpoint_x_1\n0,0\n".into(),
            Some("setpoint"),
            "setpoint_x_1 is now setpoint_alpha: convert the recording again",
        ),
    ] {
        let file = machine.path("table.csv");
        fs::write(&file, text).unwrap();
        let options = group.map_or(vec![], |group| vec!["--group", group]);
        let (ended, _) = computed(&machine, "inverse-dynamics", &file, &options);
        assert_eq!(ended.status.code(), Some(2), "{words}: {}", ended.stderr);
        assert!(ended.stderr.contains(words), "{words}: {}", ended.stderr);
    }
}
