//! `hexad move --trajectory`: a file of the user's own moves the platform, or is refused before it does.

use std::fmt::Write;
use std::fs;

use hexad::messages::{MeasuredMessage, SetpointMessage};
use hexad::motion::minimum_jerk::rise;

use crate::support::children::{HANG, Hexad, run};
use crate::support::machine::Machine;
use crate::support::recorder::Recorder;
use crate::support::trio::{start_daemon, start_plant};
use crate::support::{operator, rules, turns};

/// x of the home pose \[m\], and how far the platform moves along it.
const HOME: f64 = 1.1;
const WAY: f64 = 0.05;

const SECONDS: f64 = 1.5;

#[test]
fn a_trajectory_moves_the_platform() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("trajectory");
    let file = machine.path("rise.csv");
    fs::write(&file, table(&rows())).expect("a trajectory");
    let recorder = Recorder::start(&machine.name);
    let plant = start_plant(&machine);
    let daemon = start_daemon(&machine);
    let setpoints = Hexad::start(&machine, "move", &["--trajectory".as_ref(), file.as_os_str()]);
    operator::engage(&machine);
    let ended = setpoints.ends_within(HANG);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    // The last setpoint was at rest: losing it is no fault.
    daemon.says("stopping: setpoint source ended at rest");
    daemon.says("standby: setpoint source ended at rest");
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);

    let recording = recorder.finish();
    rules::hold(&recording);
    rules::ends_at_rest(&recording);
    let (first, last) = (&recording.measured[0], recording.measured.last().expect("measurements"));
    assert!((first.x[3] - HOME).abs() < 1e-12 && rules::stands(first), "{first:#?}");
    assert!((last.x[3] - (HOME + WAY)).abs() < 1e-3 && rules::stands(last), "{last:#?}");
    for (k, name) in [0, 1, 2, 4, 5].into_iter().zip(["alpha", "beta", "gamma", "y", "z"]) {
        let furthest = recording.measured.iter().fold(0.0_f64, |most, message| most.max(message.x[k].abs()));
        assert!(furthest < 1e-3, "{name} was to stay: {furthest}");
    }
    follows_the_file(&recording.setpoints, &recording.measured);
}

/// Between the rows too: the setpoints are the minimum-jerk move, from when they first move.
fn follows_the_file(setpoints: &[SetpointMessage], measured: &[MeasuredMessage]) {
    let moving = |message: &&SetpointMessage| message.x_rate[3] > 0.0;
    let moves: Vec<_> = setpoints.iter().filter(moving).collect();
    let fastest = moves.iter().map(|message| message.x_rate[3]).fold(0.0, f64::max);
    let expected = 1.875 * WAY / SECONDS;
    assert!((fastest / expected - 1.0).abs() < 0.03, "{fastest} m/s for {expected} m/s");
    let [Some(first), Some(last)] = [moves.first(), moves.last()] else { panic!("no setpoint moves") };
    let took = (last.header.time_ns - first.header.time_ns) as f64 * 1e-9;
    assert!((took - SECONDS).abs() < 0.2, "{took} s for {SECONDS} s");
    let seen = measured.iter().map(|message| message.twist[3]).fold(0.0, f64::max);
    assert!((seen / expected - 1.0).abs() < 0.1, "the platform made {seen} m/s of {expected} m/s");
}

#[test]
fn bad_trajectories_are_refused_by_file_and_value() {
    let machine = Machine::patient("bad-trajectory");
    let good = rows();
    let last = good.len() - 1;
    let changed = |row: usize, column: usize, value: f64| {
        let mut rows = good.clone();
        rows[row][column] = value;
        table(&rows)
    };
    let without = |column: &str| table(&good).replacen(column, &format!("not_{column}"), 1);
    let not_a_number = table(&good).replacen("1.1,", "one,", 1);
    let cases: [(&str, String, &[&str]); 9] = [
        ("moving_start", changed(0, 10, 0.25), &["first row", "0.25", "at rest"]),
        ("moving_end", changed(last, 7, -0.125), &["last row", "0.125", "at rest"]),
        ("accelerating_start", changed(0, 16, 0.75), &["first row", "0.75", "at rest"]),
        ("backwards", changed(3, 0, 0.1), &["t = 0.1", "must increase"]),
        ("twice", changed(1, 0, 0.0), &["t = 0.0 after t = 0.0", "must increase"]),
        ("no_rate", without("y_rate"), &["line 1", "missing columns y_rate"]),
        ("no_t", without("t,"), &["line 1", "missing columns t"]),
        ("words", not_a_number, &["line 2", "x = \"one\"", "must be a number"]),
        ("infinite", changed(2, 4, f64::INFINITY), &["line 4", "x = inf", "must be finite"]),
    ];
    for (name, text, words) in cases {
        let file = machine.path(&format!("{name}.csv"));
        fs::write(&file, text).expect("a trajectory");
        let arguments = [
            "move".as_ref(),
            "--config".as_ref(),
            machine.file.as_os_str(),
            "--trajectory".as_ref(),
            file.as_os_str(),
        ];
        let ended = run(&machine, &arguments);
        assert_eq!(ended.status.code(), Some(2), "{name}: {}", ended.stderr);
        let message = ended.stderr;
        assert!(message.starts_with(&format!("hexad: {}: ", file.display())), "{name}: {message}");
        assert_eq!(message.lines().count(), 1, "{name}: {message}");
        for word in words {
            assert!(message.contains(word), "{name}: {word:?} must be in {message}");
        }
    }
}

/// What the daemon would refuse in motion is told by the row on the way to which it would.
#[test]
fn what_the_daemon_would_refuse_is_told_before_it_begins() {
    let envelope = "[envelope]\nvelocity = [9.0, 9.0, 9.0, 9.0, 9.0, 9.0]\nacceleration = [9.0, 9.0, 9.0, 9.0, 9.0, 9.0]\n\
                    pose_min = [-0.1, -0.1, -0.1, -0.1, -0.1, -0.1]\npose_max = [0.1, 0.1, 0.1, 0.04, 0.1, 0.1]";
    let limit = |key: &str| format!("[limits]\n{key}");
    // The move is fastest in the middle, which is line 7, strongest at a fifth of the time. With
    // too much jerk the reference falls behind, until it is too far away.
    let cases: [(&str, String, &[&str]); 5] = [
        (
            "velocity",
            limit("velocity_m_s = 0.06"),
            &["line 7", ": velocity: ", "the setpoint is 1.0", " times the limit in [limits]"],
        ),
        (
            "acceleration",
            limit("acceleration_m_s2 = 0.12"),
            &["line 4", ": acceleration: ", "is 1.0", " times the limit"],
        ),
        (
            "jerk",
            limit("jerk_m_s3 = 0.5"),
            &["line 7", "setpoint beyond the limits", "is 1.0", " times the tolerance control.engage_*"],
        ),
        (
            "envelope",
            envelope.into(),
            &["line 9", "coordinate 1.14", " of axis 4 is outside [envelope], whose bound is 1.14"],
        ),
        ("reach", String::new(), &["line 10", "beyond the stroke of a leg", " m of leg ", "whose bound is "]),
    ];
    for (name, sections, words) in cases {
        let machine = Machine::with("beforehand", &sections);
        let file = machine.path(&format!("{name}.csv"));
        let mut rows = rows();
        if name == "reach" {
            // Ten times as far in ten times the time.
            for row in &mut rows {
                (row[0], row[4], row[16]) = (10.0 * row[0], HOME + 10.0 * (row[4] - HOME), 0.1 * row[16]);
            }
        }
        fs::write(&file, table(&rows)).expect("a trajectory");
        let (to, config) = (file.as_os_str(), machine.file.as_os_str());
        let ended =
            run(&machine, &["move".as_ref(), "--config".as_ref(), config, "--trajectory".as_ref(), to]);
        assert_eq!(ended.status.code(), Some(2), "{name}: {}", ended.stderr);
        let first = ended.stderr.lines().next().expect("a message");
        assert!(first.starts_with(&format!("hexad: {}: ", file.display())), "{name}: {first}");
        for word in words {
            assert!(first.contains(word), "{name}: {word:?} must be in {first}");
        }
    }
}

/// t, X, X', X'' of a minimum-jerk move along x, by rows so far apart that what is between them matters.
fn rows() -> Vec<Vec<f64>> {
    (0..=10)
        .map(|k| {
            let t = SECONDS * f64::from(k) / 10.0;
            let s = rise(t, SECONDS);
            let mut row = vec![0.0; 19];
            (row[0], row[4], row[10], row[16]) = (t, HOME + WAY * s.value, WAY * s.rate, WAY * s.accel);
            row
        })
        .collect()
}

fn table(rows: &[Vec<f64>]) -> String {
    let axes = ["alpha", "beta", "gamma", "x", "y", "z"];
    let names = ["", "_rate", "_accel"].iter().flat_map(|suffix| axes.map(|axis| format!("{axis}{suffix}")));
    let mut text = std::iter::once("t".into()).chain(names).collect::<Vec<_>>().join(",");
    for row in rows {
        text.push('\n');
        for (k, value) in row.iter().enumerate() {
            write!(text, "{}{value:?}", if k == 0 { "" } else { "," }).expect("a string takes all");
        }
    }
    text + "\n"
}
