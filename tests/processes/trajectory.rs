//! `hexad move --trajectory`: a file of the user's own moves the platform.

use std::fs;

use hexad::messages::{MeasuredMessage, SetpointMessage};
use hexad::motion::minimum_jerk::rise;
use hexad::text::csv_table::trajectory_columns;

use crate::support::children::Hexad;
use crate::support::machine::Machine;
use crate::support::trio::Trio;
use crate::support::{operator, rules};

/// x of the home pose \[m\], and how far the platform moves along it.
const HOME: f64 = 1.1;
const WAY: f64 = 0.05;

const SECONDS: f64 = 1.5;

#[test]
#[apply(beside_others)]
fn a_trajectory_moves_the_platform() {
    let trio = Trio::standing(Machine::patient("trajectory"));
    let file = trio.machine.path("rise.csv");
    fs::write(&file, table()).expect("a trajectory");
    let setpoints = Hexad::start(&trio.machine, "move", &["--trajectory".as_ref(), file.as_os_str()]);
    operator::engage(&trio.machine);
    setpoints.ends().succeeds();
    // The last setpoint was at rest: losing it is no fault.
    trio.daemon.says("stopping: setpoint source ended at rest");
    trio.daemon.says("standby: setpoint source ended at rest");
    let recording = trio.finish();
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

/// A minimum-jerk move along x, by rows so far apart that what is between them matters.
fn table() -> String {
    let row = |k: u32| {
        let t = SECONDS * f64::from(k) / 10.0;
        let s = rise(t, SECONDS);
        let [x, rate, accel] = [HOME + WAY * s.value_share, WAY * s.rate_per_s, WAY * s.accel_per_s2];
        format!("{t:?},0,0,0,{x:?},0,0,0,0,0,{rate:?},0,0,0,0,0,{accel:?},0,0\n")
    };
    trajectory_columns().join(",") + "\n" + &(0..=10).map(row).collect::<String>()
}
