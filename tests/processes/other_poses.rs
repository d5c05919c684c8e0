//! A platform that stands in another pose with the same leg lengths than the one that a daemon finds from home: control does not begin
//! before another sensor, or a person, has decided.

use std::fs;
use std::time::Duration;

use hexad::messages::MeasuredMessage;
use serde_json::json;

use crate::support::background::publish;
use crate::support::children::Hexad;
use crate::support::machine::Machine;
use crate::support::operator::{ask, is_refused};
use crate::support::socket::{Client, pose};
use crate::support::trio::{let_pass, start_daemon};

/// Where the platform stands, 0.9 m from where the lengths lead from home, and its lengths.
const TRUTH: [f64; 6] = [0.322, -0.2587, -0.031, -2.5051, -0.6061, 0.021];
const LENGTHS: [f64; 6] = [
    1.3225627247778478,
    1.6725957191031575,
    1.04661066073623,
    0.6024232262414161,
    2.1903400394216312,
    1.9936330834688747,
];
const REFUSAL: &str = "another pose has the measured leg lengths";
const NEXT_REASON: &str = "engage was refused: no setpoint";

fn measured() -> MeasuredMessage {
    MeasuredMessage { length_m: LENGTHS, rates_valid: 1, ..MeasuredMessage::default() }
}

/// A machine of which no pose near home is meant, and its daemon.
fn started(test: &str) -> (Machine, Hexad) {
    let machine = Machine::patient(test);
    let text = include_str!("../../config/tsai2000.toml");
    let named = text.replace("name = \"tsai2000\"", &format!("name = \"{}\"", machine.name));
    assert_ne!(named, text);
    fs::write(&machine.file, named).expect("a machine file");
    let daemon = start_daemon(&machine);
    (machine, daemon)
}

/// Largest difference between where the daemon takes the platform to be, and where it stands.
fn error(machine: &Machine) -> f64 {
    pose(machine).iter().zip(TRUTH).map(|(found, truth)| (found - truth).abs()).fold(0.0, f64::max)
}

#[test]
#[apply(beside_others)]
fn a_person_says_in_which_pose_the_platform_stands() {
    let (machine, daemon) = started("other-pose");
    let driver = publish(&machine, measured());
    daemon.says("so control does not begin: pose 1 (estimated)");
    is_refused(&machine, "engage", &[], REFUSAL);
    assert!(error(&machine) > 0.5);
    is_refused(&machine, "park", &[], REFUSAL);
    is_refused(&machine, "engage", &["--pose", "9"], "no pose 9; pose 1 (estimated): X = [");
    let mut remote = Client::connect(&daemon);
    let answer = remote.ask("engage", &json!({"pose": 1, "remote": "a bridge"}));
    assert_eq!(answer["result"], "refused", "{answer}");
    is_refused(&machine, "engage", &["--pose", "2", "--within", "2"], "no setpoint");
    assert!(error(&machine) < 1e-6, "{}", error(&machine));
    is_refused(&machine, "engage", &[], NEXT_REASON);

    // What was decided is void when the pose was lost, and so are the numbers.
    drop(driver);
    let_pass(Duration::from_millis(600));
    let driver = publish(&machine, measured());
    is_refused(&machine, "engage", &["--wait", "--within", "2"], REFUSAL);
    let refusal = ask(&machine, "engage", &["--pose", "2"]).fails(1, "no pose 2; pose ");
    let number = refusal.split("; pose ").nth(1).and_then(|it| it.split(' ').next()).expect("a number");
    machine.hexad("goto", &["--engage", "--relative", "--z=-30mm"]).fails(1, REFUSAL);
    // The setpoint of the motion that was refused.
    is_refused(&machine, "engage", &["--pose", number], "engage was refused: setpoint");
    drop(driver);
    daemon.stops();
}

#[test]
#[apply(beside_others)]
fn another_sensor_says_in_which_pose_the_platform_stands() {
    let (machine, daemon) = started("other-sensor");
    let _driver = publish(&machine, MeasuredMessage { x: TRUTH, pose_valid: 1, ..measured() });
    daemon.says("an external pose, or an operator, has confirmed the assembly mode");
    is_refused(&machine, "engage", &[], NEXT_REASON);
    assert!(error(&machine) < 1e-6, "{}", error(&machine));
    daemon.stops();
}
