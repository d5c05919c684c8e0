//! `hexad doctor` where it does not measure, or not to the end.

use std::time::Duration;

use serde_json::Value;

use crate::support::children::{Ended, Hexad, run};
use crate::support::machine::Machine;
use crate::support::trio::{start_daemon, start_plant};

#[test]
#[apply(beside_others)]
fn a_controller_at_work_is_not_disturbed_unasked() {
    let machine = Machine::patient("doctor-running");
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    let Ended { status, stdout, stderr } = run(&machine, &["doctor", "--seconds", "1"]);
    assert_eq!(status.code(), Some(2), "{stderr}");
    assert!(stderr.starts_with("hexad: not measured: it would delay the controller of process "), "{stderr}");
    assert!(stdout.contains("kernel  ") && !stdout.contains("wake-up"), "facts disturb nobody:\n{stdout}");
    let Ended { status, stdout, .. } = run(&machine, &["doctor", "--seconds", "1", "--json"]);
    let json: Value = serde_json::from_str(&stdout).expect("JSON");
    let found = (status.code(), &json["verdict"], json["rates"].as_array().map(Vec::len));
    assert_eq!(found, (Some(2), &Value::Null, Some(0)));
    assert!(json["facts"].as_array().is_some_and(|facts| !facts.is_empty()), "{json}");
    daemon.stops();
    plant.stops();
}

#[test]
#[apply(beside_others)]
fn a_signal_ends_it() {
    let machine = Machine::patient("doctor-signal");
    let doctor = Hexad::start(&machine, "doctor", &["--seconds", "600", "--disturb"]);
    // The facts are there; then it measures, or is about to.
    while std::fs::read_dir(format!("/proc/{}/task", doctor.id())).expect("its threads").count() < 3 {
        std::thread::sleep(Duration::from_millis(2));
    }
    doctor.signal("INT");
    let Ended { status, stdout, stderr } = doctor.ends();
    assert_eq!((status.code(), stderr.as_str()), (Some(1), "hexad: stopped by a signal\n"), "{stdout}");
    assert!(!stdout.contains("wake-up"), "half a measurement is none:\n{stdout}");
}
