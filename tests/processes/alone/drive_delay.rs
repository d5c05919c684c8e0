//! `hexad identify`: the dead time of the plant, from a recording of real processes.

use serde_json::Value;

use crate::support::children::{Ended, Hexad, run};
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::ask;
use crate::support::trio::start_plant;

/// Dead time of the plant \[us\].
const DEAD_TIME_US: f64 = 3000.0;
/// From the release to the plant, beside it \[us\]: the cycle, two messages, and the plant's own step of a period.
const LONGEST_WAY_US: f64 = 1600.0;

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn the_dead_time_of_the_drives_is_measured() {
    let sections = format!("{PATIENT}\n[plant.drive]\ndead_time_us = {DEAD_TIME_US:?}\n");
    let machine = Machine::with("drive-delay", &sections);
    let plant = start_plant(&machine);
    let folder = machine.path("record");
    let daemon = Hexad::start(&machine, "run", &["--record".as_ref(), folder.as_os_str()]);
    daemon.says("running");
    let source = Hexad::start(&machine, "move", &["--motion", "sines", "--seconds", "8"]);
    let engaged = ask(&machine, "engage", &["--wait", "--within", "10"]);
    assert!(engaged.status.success(), "{}", engaged.stderr);
    assert!(source.ends().status.success());
    daemon.stops();
    plant.stops();

    let files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    let recording = files[0].display().to_string();
    let Ended { status, stdout, stderr } = run(&machine, &["identify", &recording]);
    assert!(status.success(), "{stderr}");
    assert!(stdout.contains("\n[drive]\ndelay_us = "), "{stdout}");
    let Ended { stdout, .. } = run(&machine, &["identify", "--json", &recording]);
    let found: Value = serde_json::from_str(&stdout).unwrap();
    let delay_us = found["delay_us"].as_f64().unwrap();
    println!("{delay_us} us");
    assert!((DEAD_TIME_US..DEAD_TIME_US + LONGEST_WAY_US).contains(&delay_us), "{stdout}");
}
