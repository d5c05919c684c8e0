//! At start-up the operator is told when the measured lengths are also those of another pose nearby.

use std::fs;
use std::thread::sleep;
use std::time::Duration;

use crate::support::children::HANG;
use crate::support::machine::{Machine, PATIENT};
use crate::support::trio::{start_daemon, start_plant};

const WORDS: &str = "the measured lengths are also those of another pose";

/// Many times what the search takes: some hundredths of a second.
const SEARCHED: Duration = Duration::from_secs(3);

/// The machine of the paper, with the platform of home turned about the horizontal axis to its base.
fn turned(alpha: f64) -> Machine {
    let machine = Machine::with("modes", PATIENT);
    let text = fs::read_to_string(&machine.file).unwrap();
    let home = "pose = [0.0, 0.0, 0.0, 1.1,";
    assert!(text.contains(home));
    fs::write(&machine.file, text.replace(home, &format!("pose = [{alpha}, 0.0, 0.0, 1.1,"))).unwrap();
    machine
}

#[test]
fn another_pose_near_the_first_is_told_once() {
    let machine = turned(1.43);
    let _plant = start_plant(&machine);
    let daemon = start_daemon(&machine);
    daemon.says(WORDS);
    sleep(SEARCHED);
    let said = daemon.stops_on("TERM", HANG).stderr;
    let lines: Vec<_> = said.lines().filter(|line| line.contains(WORDS)).collect();
    let words = "16.1 deg and 0.076 m away, across a singular pose: see that the platform is where it is taken to \
                 be, [1.430000, 0.000000, 0.000000, 1.100000, 0.000000, 0.000000], before you engage";
    assert!(lines.len() == 1 && lines[0].contains(words) && lines[0].contains("WARN"), "{said}");
}

#[test]
fn where_no_other_pose_is_near_nothing_is_said() {
    let machine = turned(0.0);
    let _plant = start_plant(&machine);
    let daemon = start_daemon(&machine);
    daemon.says("standby");
    sleep(SEARCHED);
    let said = daemon.stops_on("TERM", HANG).stderr;
    assert!(!said.contains("pose,") && !said.contains("WARN nobody looks"), "{said}");
}
