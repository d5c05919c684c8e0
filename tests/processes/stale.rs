//! After a pause of the daemon nothing old begins control, what stops still stops, and a fault keeps its numbers.

use std::time::Duration;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;
use serde_json::json;

use crate::support::machine::{Machine, TIMEOUT_NS};
use crate::support::operator::clear;
use crate::support::peer::Controlled;
use crate::support::recorder::Recorder;
use crate::support::socket::{Client, status};
use crate::support::trio::{Trio, let_pass, start_daemon, valid_after};

/// Longer than a request for control stays valid, with room for a slow signal.
const PAUSE: Duration = Duration::from_millis(1500);

/// Longer than the daemon takes to receive what was sent before.
const AFTERWARDS: Duration = Duration::from_millis(800);

#[test]
#[apply(beside_others)]
fn an_old_engage_is_not_obeyed_and_a_fresh_one_is() {
    let machine = Machine::patient("old-engage");
    let recorder = Recorder::start(&machine.name);
    let daemon = start_daemon(&machine);
    let Controlled { peer: _peer, daemon, plant, machine: _machine } = Controlled::ready(machine, daemon);
    daemon.says("standby: ready to engage");
    let mut client = Client::connect(&daemon);
    let from_ns = monotonic_ns();
    daemon.hold();
    client.send("{\"version\": 1, \"request\": \"engage\"}\n");
    let_pass(PAUSE);
    daemon.signal("CONT");
    let answer = client.answer();
    assert_eq!(answer["result"], "stale", "{answer}");
    assert_eq!(answer["text"], "the daemon was held and the request may be old; send it again");
    let_pass(AFTERWARDS);
    let is_obeyed = recorder.so_far().forces.iter().any(|force| valid_after(force, from_ns));
    assert!(!is_obeyed, "an old request was obeyed");
    assert_eq!(client.ask("engage", &json!({}))["result"], "accepted");
    recorder.until("a fresh request is obeyed", |recording| {
        recording.forces.last().filter(|force| force.state == State::Active as u32).map(drop)
    });
    daemon.stops();
    plant.stops();
}

#[test]
#[apply(beside_others)]
fn an_old_stop_is_obeyed() {
    let machine = Machine::patient("old-stop");
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::start(machine);
    let mut client = Client::connect(&daemon);
    daemon.hold();
    client.send("{\"version\": 1, \"request\": \"estop\"}\n");
    let_pass(PAUSE);
    daemon.signal("CONT");
    assert_eq!(client.answer()["diagnostic"]["code"], 110);
    clear(&machine);
    daemon.stops();
    plant.stops();
}

/// Value and bound are those of the cycle in which the fault began, and stay.
#[test]
#[apply(beside_others)]
fn a_latched_fault_keeps_its_value_and_bound() {
    let mut trio = Trio::in_motion("latched");
    trio.plant.kill();
    trio.loses_force_for(DiagnosticCode::MeasurementLost);
    let first = status(&trio.machine)["diagnostic"].clone();
    let_pass(Duration::from_millis(300));
    let later = status(&trio.machine)["diagnostic"].clone();
    assert_eq!(first, later, "it was latched");
    assert_eq!((&first["code"], &first["bound"]), (&json!(101), &json!(TIMEOUT_NS as f64 * 1e-9)));
    let age_s = first["value"].as_f64().expect("a value");
    let bound_s = TIMEOUT_NS as f64 * 1e-9;
    assert!(age_s > bound_s && age_s < bound_s + 1.0, "{first}");
    let text = first["text"].as_str().expect("a sentence");
    assert!(
        text.starts_with("measurement lost: age 0.")
            && text.contains(" s exceeds timeouts.measured_ms 0.4 s"),
        "{text}"
    );
    trio.daemon.says("fault: measurement lost: age 0.");
}
