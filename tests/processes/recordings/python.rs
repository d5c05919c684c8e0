//! Recordings open in Python with the packages of MCAP and of its ROS 2 messages.

use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use hexad::messages::CycleMessage;
use serde_json::Value;

use super::{files, read, start_recording};
use crate::support::machine::Machine;
use crate::support::operator::engage;
use crate::support::trio::{start_plant, start_setpoints};
use hexad_support::not_run::lacking;
use hexad_support::python::{environment, output};

/// Packages, with the versions that were tried.
const PACKAGES: [&str; 2] = ["mcap==1.6.0", "mcap-ros2-support==0.6.0"];

#[test]
#[ignore = "second tier: needs PyPI"]
#[apply(beside_others)]
fn a_recording_opens_in_python() {
    let python = match environment(&PACKAGES.map(String::from)) {
        Ok(folder) => folder.join("bin/python"),
        Err(why) => return lacking(&why),
    };
    let machine = Machine::patient("recorded-python");
    let plant = start_plant(&machine);
    let daemon = start_recording(&machine);
    let source = start_setpoints(&machine);
    engage(&machine);
    sleep(Duration::from_secs(1));
    daemon.stops();
    plant.stops();
    drop(source);
    let file = &files(&machine, "record")[0];
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients/recording.py");
    let printed = output(Command::new(python).arg("-B").arg(script).arg(file)).unwrap();
    let found: Value = serde_json::from_str(&printed).unwrap();
    let (summary, cycles) = read(file);
    let last = cycles[cycles.len() - 1];
    let shown = |numbers: &[f64]| serde_json::to_value(numbers).unwrap();
    assert_eq!(found["cycles"], cycles.len());
    assert_eq!(found["last"]["cycle"], last.cycle);
    assert_eq!(found["last"]["length"], shown(&last.measured_length_m));
    assert_eq!(found["last"]["code"], last.diagnostic.code);
    assert_eq!(found["name"], summary.info.name.as_str());
    assert_eq!(found["joints"], serde_json::json!(["leg_1", "leg_2", "leg_3", "leg_4", "leg_5", "leg_6"]));
    // The end of each leg, moved by its frames, is at the joint of the platform.
    let gap = found["largest_gap_m"].as_f64().unwrap();
    assert!(gap < 1e-9, "{gap} m between rod and joint");
    assert_eq!(found["frames"], 19);
    // 100 times a second, where the pose is known.
    let has_scene = |cycle: &&CycleMessage| cycle.has_platform == 1 && cycle.cycle.is_multiple_of(10);
    assert_eq!(found["scenes"], cycles.iter().filter(has_scene).count());
}
