//! Panels move the platform over the control socket: who may, what is refused, and what ends a motion.

mod flood;
mod member;

use std::thread::sleep;
use std::time::Duration;

use hexad::messages::SetpointMessage;
use hexad::messages::clock::monotonic_ns;
use hexad::model::task::TaskState;
use serde_json::{Value, json};

use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::does;
use crate::support::recorder::Recording;
use crate::support::socket::{Client, pose, state};
use crate::support::trio::{Trio, fastest, let_pass};

/// A leg faster than this is in motion \[m/s\].
const IN_MOTION: f64 = 0.002;

const FRAME: &str = "
[[frame]]
name = \"tip\"
kind = \"tool\"
pose = [0.0, 0.0, 0.0, 0.3, 0.0, 0.0]
";

fn standing(test: &str, sections: &str) -> Trio {
    Trio::standing(Machine::with(test, &format!("{PATIENT}{FRAME}{sections}")))
}

fn until_in_motion(trio: &Trio) {
    let began_ns = monotonic_ns();
    trio.recorder.until("the platform moves", |recording| {
        let last = recording.measured.last().filter(|last| last.header.time_ns > began_ns);
        last.filter(|last| fastest(last) > IN_MOTION).map(drop)
    });
}

/// The platform comes to rest under control and stands for a while.
fn until_it_stands(trio: &Trio) {
    let began_ns = monotonic_ns();
    trio.recorder.until("the platform stands", |recording| {
        let newest = recording.measured.iter().rev().take(200);
        let is_still = newest.clone().all(|it| it.header.time_ns > began_ns && fastest(it) < 1e-3);
        (newest.count() == 200 && is_still).then_some(())
    });
    assert_eq!(state(&trio.machine), "active");
}

/// Stops and ends everything. No fault has occurred, and every rule holds.
fn finish(trio: Trio) -> Recording {
    does(&trio.machine, "stop", &[], &["standby"]);
    let recording = trio.finish();
    recording.has_no_fault();
    recording
}

/// A client that is not `hexad`.
struct Panel(Client);

impl Panel {
    fn of(trio: &Trio) -> Self {
        Self(Client::connect(&trio.daemon))
    }

    /// The next answer: its result and text.
    fn answer(&mut self) -> (String, String) {
        let answer = self.0.answer();
        let text = |key: &str| answer[key].as_str().expect("text").to_owned();
        (text("result"), text("text"))
    }

    /// A request with this result; the text of the answer.
    fn does(&mut self, request: &str, more: &Value, result: &str) -> String {
        self.0.request(request, more);
        let (found, text) = self.answer();
        assert_eq!(found, result, "{request} {more}: {text}");
        text
    }
}

#[test]
#[apply(beside_others)]
fn a_bad_request_is_refused_with_its_field() {
    let trio = standing("panels", "");
    let mut panel = Panel::of(&trio);
    for (request, more, words) in [
        ("goto", json!({}), "target: is missing"),
        (
            "goto",
            json!({"target": {"x_m": 1e300}}),
            "target.x_m = 1e300: must be in [-1000.0, 1000.0]; send m",
        ),
        ("goto", json!({"target": {"x_mm": 1}}), "unknown field `x_mm`"),
        ("goto", json!({"target": {"x_m": 1.9}}), "outside of the workspace: leg"),
        ("goto", json!({"home": true, "speed": 2}), "speed = 2.0: must be in [0.01, 1.0]"),
        ("goto", json!({"home": true, "tolerance_m": 0}), "tolerance_m = 0.0: must be in [1e-9, 0.1]"),
        ("goto", json!({"home": true, "relative": true}), "exclude each other"),
        ("goto", json!({"home": true, "rate": {}}), "rate: is no field of goto; leave it out"),
        ("goto", json!({"home": true, "tool": "tap"}), "no tool frame \"tap\", must be one of: tip"),
        ("goto", json!({"home": true, "rotation": "xyx"}), "rotation = \"xyx\": must be one of xyz, xzy"),
        ("jog", json!({}), "rate: is missing"),
        ("jog", json!({"rate": {"x_m_s": 0.3}}), "norm of x, y, z = 0.3 m/s: must be at most 0.2"),
        ("jog", json!({"rate": {}, "engage": true}), "engage: is no field of jog"),
        ("hold", json!({"target": {"x_m": 1}}), "target: is no field of hold"),
        ("engage", json!({"speed": 0.1}), "speed: is no field of engage"),
        ("clear", json!({"pose": 2}), "pose: is no field of clear"),
    ] {
        let text = panel.does(request, &more, "invalid");
        assert!(text.contains(words), "{words:?} must be in {text}");
    }
    panel.0.send("{\"version\": 1, \"request\": \"goto\", \"target\": {\"x_m\": NaN}}\n");
    assert_eq!(panel.answer().0, "invalid");
    for (request, more) in
        [("goto", json!({"home": true})), ("hold", json!({})), ("jog", json!({"rate": {"x_m_s": 0.01}}))]
    {
        let text = panel.does(request, &more, "refused");
        assert!(text.contains("not under control (state standby"), "{text}");
    }
    assert!(trio.recorder.so_far().setpoints.is_empty(), "nothing was published");
    finish(trio);
}

#[test]
#[apply(beside_others)]
fn a_target_is_reached_in_the_coordinates_of_the_request() {
    let trio = standing("panel-target", "");
    let mut panel = Panel::of(&trio);
    let began_ns = monotonic_ns();
    let there = json!({"target": {"x_m": 0.02, "gamma_rad": 0.05}, "relative": true, "wait": true});
    assert_eq!(
        panel.does("hold", &json!({"engage": true, "wait": true}), "done"),
        "the platform stands under control"
    );
    let text = panel.does("goto", &there, "done");
    assert!(text.starts_with("in position after "), "{text}");
    let x = pose(&trio.machine);
    assert!((x[3] - 1.12).abs() < 1e-4 && (x[2] - 0.05).abs() < 1e-4, "{x:?}");
    // The same angles in another order are another orientation.
    let zyx = json!({"target": {"alpha_rad": 0.1, "beta_rad": 0.1, "gamma_rad": 0.05}, "rotation": "zyx", "wait": true});
    panel.does("goto", &zyx, "done");
    let x = pose(&trio.machine);
    assert!((x[0] - 0.1).abs() > 1e-3 && (x[0] - 0.1).abs() < 1e-2, "{x:?}");
    // A tool turns about its origin.
    panel.does("goto", &json!({"home": true, "wait": true}), "done");
    let turn = json!({"target": {"gamma_rad": 0.07, "beta_rad": -0.03}, "tool": "tip", "wait": true});
    let turned_ns = monotonic_ns();
    panel.does("goto", &turn, "done");
    let recording = finish(trio);
    assert!(recording.setpoints.iter().all(|setpoint| setpoint.header.time_ns > began_ns));
    let moving = |it: &&SetpointMessage| it.header.time_ns > turned_ns && it.x_rate.iter().any(|x| *x != 0.0);
    let off = recording.setpoints.iter().filter(moving).map(|setpoint| {
        let pose = TaskState::at_rest(setpoint.x).motion().pose;
        (pose.position + pose.rotation.column(0) * 0.3 - nalgebra::Vector3::new(1.4, 0.0, 0.0)).norm()
    });
    let off: Vec<f64> = off.collect();
    let farthest = off.iter().copied().fold(0.0, f64::max);
    assert!(off.len() > 100 && farthest < 1e-12, "{} setpoints, {farthest} m", off.len());
}

#[test]
#[apply(beside_others)]
fn a_jog_ends_without_messages_and_with_its_connection() {
    let trio = standing("panel-jog", "");
    let mut panel = Panel::of(&trio);
    panel.does("hold", &json!({"engage": true, "wait": true}), "done");
    // The motion belongs to its connection.
    let mut other = Panel::of(&trio);
    for (request, more) in
        [("goto", json!({"home": true})), ("hold", json!({})), ("jog", json!({"rate": {}}))]
    {
        let text = other.does(request, &more, "refused");
        assert!(text.contains(&format!("a hold of process {} is in progress", std::process::id())), "{text}");
    }
    let up = json!({"rate": {"z_m_s": 0.04}});
    let jog = |panel: &mut Panel| {
        let began_m = pose(&trio.machine)[5];
        while pose(&trio.machine)[5] < began_m + 0.01 {
            for _ in 0..5 {
                panel.does("jog", &up, "accepted");
                sleep(Duration::from_millis(20));
            }
        }
    };
    jog(&mut panel);
    until_it_stands(&trio);
    let stands = pose(&trio.machine);
    let_pass(Duration::from_millis(500));
    assert!((pose(&trio.machine)[5] - stands[5]).abs() < 1e-4, "it stands: {:?}", pose(&trio.machine));
    // A connection that ends in the middle.
    jog(&mut panel);
    drop(panel);
    until_it_stands(&trio);
    assert!(pose(&trio.machine)[5] > stands[5] + 0.005, "{:?}", pose(&trio.machine));
    // A target that a connection waits for ends with the connection; one that it does not wait for remains.
    let slowly = json!({"target": {"z_m": 0.0}, "speed": 0.05, "wait": true, "progress": true});
    other.0.request("goto", &slowly);
    assert_eq!(other.answer().0, "accepted");
    until_in_motion(&trio);
    drop(other);
    until_it_stands(&trio);
    let left = pose(&trio.machine);
    assert!(left[5] > 0.002, "on the way: {left:?}");
    Panel::of(&trio).does("goto", &json!({"target": {"z_m": 0.0}}), "accepted");
    trio.recorder.until("the target is followed", |recording| {
        recording.setpoints.last().filter(|last| last.x[5] == 0.0).map(drop)
    });
    until_it_stands(&trio);
    assert!(pose(&trio.machine)[5].abs() < 1e-4, "{:?}", pose(&trio.machine));
    finish(trio);
}

/// A later motion of the same connection takes over, and a stop ends all of them.
#[test]
#[apply(beside_others)]
fn a_later_motion_takes_over_and_a_stop_ends_it() {
    let trio = standing("panel-later", "");
    let mut panel = Panel::of(&trio);
    panel.does("goto", &json!({"home": true, "engage": true, "wait": true}), "done");
    let step = |speed: f64| json!({"target": {"z_m": 0.03}, "relative": true, "wait": true, "speed": speed});
    panel.0.request("goto", &step(0.1));
    until_in_motion(&trio);
    panel.0.request("goto", &step(1.0));
    let (first, second) = (panel.answer(), panel.answer());
    assert_eq!((first.0.as_str(), second.0.as_str()), ("superseded", "done"), "{first:?} {second:?}");
    // Steps add up, wherever the platform is when they arrive.
    assert!((pose(&trio.machine)[5] - 0.06).abs() < 1e-4, "{:?}", pose(&trio.machine));
    panel.0.request("goto", &json!({"home": true, "tool": "tip", "wait": true, "speed": 0.2}));
    until_in_motion(&trio);
    panel.does("hold", &json!({"wait": true}), "superseded");
    assert_eq!(panel.answer().0, "done");
    assert!(pose(&trio.machine)[5] > 0.005, "on the way: {:?}", pose(&trio.machine));
    // A motion that waits for control, and one that is under way: no stop is undone by them.
    panel.0.request("goto", &json!({"home": true, "wait": true, "speed": 0.2, "engage": true}));
    until_in_motion(&trio);
    panel.0.request("goto", &json!({"target": {"x_m": 1.11}, "wait": true, "engage": true}));
    assert_eq!(panel.answer().0, "superseded");
    let mut other = Panel::of(&trio);
    other.does("stop", &json!({"wait": true}), "done");
    let ended = panel.answer();
    assert!(["failed", "superseded"].contains(&ended.0.as_str()), "{ended:?}");
    let_pass(Duration::from_millis(500));
    assert_eq!(state(&trio.machine), "standby");
    finish(trio);
}

#[test]
#[apply(beside_others)]
fn a_stop_ends_the_wait_for_control() {
    let trio = standing("panel-stop", "[limits]\nautonomous_scale = 0.02\n");
    let mut panel = Panel::of(&trio);
    panel.does("hold", &json!({"engage": true, "wait": true}), "done");
    let away = json!({"target": {"z_m": 0.03}, "wait": true});
    panel.does("goto", &away, "done");
    // It takes seconds, and until then no motion takes control.
    let mut other = Panel::of(&trio);
    other.does("park", &json!({}), "accepted");
    let back = json!({"target": {"z_m": 0.03}, "wait": true, "engage": true, "progress": true});
    panel.0.request("goto", &back);
    assert_eq!(panel.answer().0, "accepted");
    assert_eq!(panel.answer(), ("waiting".into(), "not possible in state parking".into()));
    other.does("stop", &json!({"wait": true}), "done");
    assert_eq!(panel.answer().0, "superseded");
    let_pass(Duration::from_millis(500));
    assert_eq!(state(&trio.machine), "standby");
    finish(trio);
}
