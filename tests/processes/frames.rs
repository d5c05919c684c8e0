//! Frames of the machine file on the command line: a tool turns about its origin, a frame is set where the platform is.

use hexad::config::Config;
use hexad::messages::SetpointMessage;
use hexad::model::task::TaskState;

use crate::support::children::{Ended, HANG, run};
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::does;
use crate::support::recorder::Recorder;
use crate::support::rules;
use crate::support::socket::status;
use crate::support::trio::{start_daemon, start_plant};
use crate::support::turns;

const FRAMES: &str = "
[[frame]]
name = \"tip\"
kind = \"tool\"
pose = [0.0, 0.0, 0.0, 0.3, 0.0, 0.0]
[[frame]]
name = \"table\"
kind = \"work\"
pose = [0.0, 0.0, 0.0, 1.4, 0.0, 0.0]
[envelope]
pose_min = [-0.2, -0.2, -0.2, -0.1, -0.1, -0.1]
pose_max = [0.2, 0.2, 0.2, 0.1, 0.1, 0.1]
velocity = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1]
acceleration = [0.3, 0.3, 0.3, 0.3, 0.3, 0.3]
";

fn hexad(machine: &Machine, command: &[&str], more: &[&str]) -> Ended {
    let file = machine.file.display().to_string();
    run(machine, &[command, &["--config", &file], more].concat())
}

fn said(machine: &Machine, command: &[&str], more: &[&str]) -> String {
    let Ended { status, stdout, stderr } = hexad(machine, command, more);
    assert_eq!(status.code(), Some(0), "{command:?}: {stderr}");
    stdout
}

fn refused(machine: &Machine, command: &[&str], more: &[&str], words: &[&str]) {
    let Ended { status, stderr, .. } = hexad(machine, command, more);
    assert_eq!(status.code(), Some(2), "{more:?}: {stderr}");
    words.iter().for_each(|words| assert!(stderr.contains(words), "{words:?} must be in {stderr}"));
}

const TOOL: [&str; 2] = ["--tool", "tip"];
const BOTH: [&str; 4] = ["--tool", "tip", "--work", "table"];

#[test]
fn coordinates_of_a_tool_are_planned_and_refused_without_a_daemon() {
    let machine = Machine::with("frames", &format!("{PATIENT}{FRAMES}"));
    let listed = said(&machine, &["frame", "list"], &[]);
    assert!(listed.contains("tip") && listed.contains("300.000") && listed.contains("work"), "{listed}");
    refused(
        &machine,
        &["goto"],
        &["--tool", "tap", "--x", "1m", "--dry-run"],
        &["no tool frame \"tap\", must be one of: tip;"],
    );
    // Home is x = 1.1 m, the tip 0.3 m beyond it: at the table's origin.
    let plan = said(&machine, &["goto"], &[&BOTH[..], &["--gamma", "4deg", "--dry-run"]].concat());
    for words in ["coordinates of tip in table", "4.000", "the tool goes straight", "from is home"] {
        assert!(plan.contains(words), "{words}: {plan}");
    }
    let beyond = [&BOTH[..], &["--x", "150mm", "--dry-run"]].concat();
    let words =
        ["x = 1.25", "bound 1.20", "coordinates of the platform in the base frame", "1250.000", "  150.000"];
    refused(&machine, &["goto"], &beyond, &words);
}

#[test]
fn a_tool_turns_about_its_origin_and_becomes_a_frame_of_a_new_file() {
    let _turn = turns::beside_others();
    let machine = Machine::with("frames", &format!("{PATIENT}{FRAMES}"));
    let recorder = Recorder::start(&machine.name);
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    daemon.says("standby: no setpoint");
    said(&machine, &["goto"], &["--home", "--engage"]);
    let turned = said(&machine, &["goto"], &[&BOTH[..], &["--gamma", "4deg", "--beta", "-2deg"]].concat());
    assert!(
        turned.contains("in position after ") && turned.contains("coordinates of tip in table"),
        "{turned}"
    );
    let shown = said(&machine, &["status"], &BOTH);
    assert!(shown.contains("coordinates of tip in table"), "{shown}");
    let pose = shown.lines().find(|line| line.starts_with("pose")).expect("a pose");
    let numbers: Vec<f64> = pose.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
    let wanted = [0.0, -2.0, 4.0, 0.0, 0.0, 0.0];
    assert!(numbers.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 0.1), "{pose}");

    // Where the tip is, in a new file; the old one stays.
    let new = machine.path("new.toml").display().to_string();
    let before = std::fs::read_to_string(&machine.file).unwrap();
    refused(&machine, &["frame", "set", "here"], &["--here", "-o", &new], &["no frame is named \"here\""]);
    refused(
        &machine,
        &["frame", "set", "tip"],
        &["--here", "-o", &new, "--tool", "tip"],
        &["--tool must be left out"],
    );
    let set = said(
        &machine,
        &["frame", "set", "here"],
        &[&TOOL[..], &["--here", "--kind", "work", "-o", &new]].concat(),
    );
    assert!(set.contains("[[frame]]") && set.contains("new.toml: written"), "{set}");
    let config = Config::load(new.as_ref()).unwrap();
    let here = config.frames_named(Some("tip"), Some("here")).unwrap();
    let x = status(&machine)["status"]["pose"].clone();
    let x: [f64; 6] = core::array::from_fn(|k| x[k].as_f64().unwrap());
    let tip = here.tool_pose(&TaskState::at_rest(x).motion().pose).position;
    assert!(tip.norm() < 1e-4, "{tip}");
    assert_eq!(std::fs::read_to_string(&machine.file).unwrap(), before);
    refused(
        &machine,
        &["frame", "set", "here"],
        &["--here", "--kind", "work", "-o", &new],
        &["exists already"],
    );

    does(&machine, "stop", &[], &["standby"]);
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    rules::hold(&recording);
    // Every setpoint of the turn has the tip where it was.
    let moving = |setpoint: &&SetpointMessage| setpoint.x_rate.iter().any(|rate| *rate != 0.0);
    let tips = recording.setpoints.iter().filter(moving).map(|setpoint| {
        let pose = TaskState::at_rest(setpoint.x).motion().pose;
        (pose.position + pose.rotation.column(0) * 0.3 - nalgebra::Vector3::new(1.4, 0.0, 0.0)).norm()
    });
    let tips: Vec<f64> = tips.collect();
    let farthest = tips.iter().copied().fold(0.0, f64::max);
    assert!(tips.len() > 100 && farthest < 1e-12, "{} setpoints, {farthest} m", tips.len());
}
