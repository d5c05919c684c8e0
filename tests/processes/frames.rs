//! Frames of the machine file on the command line: a tool turns about its origin, a frame is set where the platform is.

use std::fs;

use hexad::config::Config;
use hexad::model::task::TaskState;

use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::does;
use crate::support::socket::pose;
use crate::support::trio::Trio;

const FRAMES: &str = include_str!("../commands/frames.toml");

const BOTH: [&str; 4] = ["--tool", "tip", "--work", "table"];

#[test]
#[apply(beside_others)]
fn a_tool_turns_about_its_origin_and_becomes_a_frame_of_a_new_file() {
    let trio = Trio::standing(Machine::with("frames", &format!("{PATIENT}\n{FRAMES}")));
    let machine = &trio.machine;
    machine.hexad("goto", &["--home", "--engage"]).succeeds();
    let turned =
        machine.hexad("goto", &[&BOTH[..], &["--gamma", "4deg", "--beta", "-2deg"]].concat()).succeeds();
    assert!(
        turned.contains("in position after ") && turned.contains("coordinates of tip in table"),
        "{turned}"
    );
    let shown = machine.hexad("status", &BOTH).succeeds();
    assert!(shown.contains("coordinates of tip in table"), "{shown}");
    let x = shown.lines().find(|line| line.starts_with("pose")).expect("a pose");
    let numbers = x.split_whitespace().skip(1).map(|word| word.parse::<f64>().unwrap());
    assert!(numbers.zip([0.0, -2.0, 4.0, 0.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 0.1), "{x}");

    // Where the tip is, in a new file; the old one stays.
    let new = machine.path("new.toml").display().to_string();
    let before = fs::read_to_string(&machine.file).unwrap();
    let set = |more: &[&str]| {
        let file = machine.file.to_str().unwrap();
        crate::support::children::run(
            machine,
            &[&["frame", "set", "--config", file, "--here", "-o", &new], more].concat(),
        )
    };
    set(&["here"]).fails(2, "no frame is named \"here\"");
    set(&["tip", "--tool", "tip"]).fails(2, "--tool must be left out");
    let here = ["here", "--kind", "work"];
    let written = set(&[&here[..], &["--tool", "tip"]].concat()).succeeds();
    assert!(written.contains("[[frame]]") && written.contains("new.toml: written"), "{written}");
    let frames = Config::load(new.as_ref()).unwrap().frames_named(Some("tip"), Some("here")).unwrap();
    let tip = frames.tool_pose(&TaskState::at_rest(pose(machine)).motion().pose).position;
    assert!(tip.norm() < 1e-4, "{tip}");
    assert_eq!(fs::read_to_string(&machine.file).unwrap(), before);
    set(&here).fails(2, "exists already");
    does(machine, "stop", &[], &["standby"]);
    trio.finish();
}
