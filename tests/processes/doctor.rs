//! `hexad doctor` where it does not measure, or not to the end.

use std::time::Duration;

use crate::support::children::{Ended, HANG, Hexad, run};
use crate::support::machine::Machine;
use crate::support::trio::{start_daemon, start_plant};
use crate::support::turns;

#[test]
fn a_processor_that_is_not_there_is_refused() {
    let machine = Machine::patient("doctor-cpu");
    let Ended { status, stdout, stderr } = run(&machine, &["doctor", "--cpu", "1000"]);
    assert_eq!((status.code(), stdout.as_str()), (Some(2), ""), "{stderr}");
    assert!(stderr.starts_with("hexad: no binding to CPU 1000: it is not online"), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
}

#[test]
fn a_controller_at_work_is_not_disturbed_unasked() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("doctor-running");
    let plant = start_plant(&machine);
    let daemon = start_daemon(&machine);
    daemon.says("INFO running");
    let Ended { status, stdout, stderr } = run(&machine, &["doctor", "--seconds", "1"]);
    assert_eq!(status.code(), Some(2), "{stderr}");
    assert!(stderr.starts_with("hexad: not measured: it would delay the controller of process "), "{stderr}");
    assert!(stdout.contains("kernel  ") && !stdout.contains("wake-up"), "facts disturb nobody:\n{stdout}");
    let Ended { status, stdout, .. } = run(&machine, &["doctor", "--seconds", "1", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&stdout).expect("JSON");
    assert_eq!(
        (status.code(), &json["verdict"], json["rates"].as_array().map(Vec::len)),
        (Some(2), &serde_json::Value::Null, Some(0))
    );
    assert!(json["facts"].as_array().is_some_and(|facts| !facts.is_empty()), "{json}");
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
}

#[test]
fn a_signal_ends_it() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("doctor-signal");
    let doctor = Hexad::start(&machine, "doctor", &["--seconds", "600", "--disturb"]);
    // The facts are there; then it measures, or is about to.
    while std::fs::read_dir(format!("/proc/{}/task", doctor.id())).expect("its threads").count() < 3 {
        std::thread::sleep(Duration::from_millis(2));
    }
    doctor.signal("INT");
    let Ended { status, stdout, stderr } = doctor.ends_within(HANG);
    assert_eq!((status.code(), stderr.as_str()), (Some(1), "hexad: stopped by a signal\n"), "{stdout}");
    assert!(!stdout.contains("wake-up"), "half a measurement is none:\n{stdout}");
}
