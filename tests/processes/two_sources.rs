//! Two processes publish the same input: the one that counts is never replaced under control, control does not begin, both
//! are named, and when one leaves the other counts.

use std::process;
use std::time::Duration;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::messages::{MeasuredMessage, SetpointMessage};
use serde_json::Value;

use crate::support::background::publish;
use crate::support::machine::Machine;
use crate::support::operator::{clear, does, engage, is_refused};
use crate::support::peer::Controlled;
use crate::support::recorder::Recorder;
use crate::support::socket::{pose, state, status};
use crate::support::trio::{let_pass, start_daemon};

/// Longer than all timeouts of a patient machine.
const SILENCE: Duration = Duration::from_millis(600);

/// Lengths of the platform at rest near home: as the plant has them, or so much longer \[m\].
fn lengths_of(machine: &Machine, longer_m: f64) -> MeasuredMessage {
    let report = status(machine);
    let legs = report["status"]["legs"].as_array().expect("legs");
    let length = |leg: &Value| leg["length_m"].as_f64().expect("a length") + longer_m;
    MeasuredMessage { length_m: core::array::from_fn(|leg| length(&legs[leg])), ..Default::default() }
}

/// The processes of a topic as `hexad status` shows them: number, and whether it is ignored.
fn processes(machine: &Machine, topic: &str) -> Vec<(u64, bool)> {
    let report = status(machine);
    let sources = report["status"]["sources"].as_array().expect("sources").clone();
    let source = sources.iter().find(|source| source["topic"] == topic).expect("the topic");
    let process = |it: &Value| {
        (it["process_id"].as_u64().expect("a number"), it["is_ignored"].as_bool().expect("a flag"))
    };
    source["processes"].as_array().expect("processes").iter().map(process).collect()
}

fn words(what: &str, used: u32, ignored: u32) -> [String; 2] {
    let name =
        |id: u32| std::fs::read_to_string(format!("/proc/{id}/comm")).expect("a name").trim_end().to_owned();
    let [first, second] = [used, ignored].map(|id| format!("process {id} ({})", name(id)));
    [format!("two sources of {what}: {first} is used"), format!("{second} is ignored; end one of them")]
}

#[test]
#[apply(beside_others)]
fn a_second_driver_never_takes_over_and_control_does_not_begin_with_two() {
    let machine = Machine::patient("two-drivers");
    let recorder = Recorder::start(&machine.name);
    let Controlled { peer, daemon, plant, machine } = Controlled::start(machine);
    let second = publish(&machine, lengths_of(&machine, 0.02));
    let [used, ignored] = words("measurements", plant.id(), process::id());
    daemon.says(&used);
    daemon.says(&ignored);
    let (from_ns, _) = let_pass(SILENCE);
    let recording = recorder.so_far();
    let after = recording.statuses.iter().filter(|status| status.header.time_ns > from_ns);
    assert!(after.clone().count() > 100, "the daemon runs");
    for status in after {
        assert_eq!(State::from_number(status.state), Some(State::Active), "{status:?}");
    }
    drop(recording);
    assert!(processes(&machine, "measured").contains(&(process::id().into(), true)));
    assert!(processes(&machine, "measured").contains(&(plant.id().into(), false)));
    does(&machine, "stop", &[], &["standby"]);
    is_refused(&machine, "engage", &[], &used);
    is_refused(&machine, "park", &[], &ignored);
    drop(second);
    engage(&machine);
    does(&machine, "stop", &[], &["standby"]);

    // The true one leaves: the other counts, though it was there all the time.
    let second = publish(&machine, lengths_of(&machine, 0.0));
    let_pass(SILENCE);
    plant.stops();
    let_pass(SILENCE);
    let age_s = status(&machine)["status"]["sources"][1]["age_s"].as_f64().expect("an age");
    assert!(age_s < SILENCE.as_secs_f64() / 2.0, "nobody counts: {age_s}");
    assert_eq!(status(&machine)["diagnostic"]["code"], DiagnosticCode::ReadyToEngage as u32);
    drop((second, peer, recorder));
    daemon.stops();
}

#[test]
#[apply(beside_others)]
fn a_second_setpoint_source_never_takes_over_and_control_does_not_begin_with_two() {
    let Controlled { mut peer, daemon, plant, machine } = Controlled::start(Machine::patient("two-players"));
    let mut far = SetpointMessage { kind: 2, ..SetpointMessage::default() };
    far.x[3] = 1.15;
    let second = publish(&machine, far);
    let [used, _] = words("setpoints", peer.id(), process::id());
    daemon.says(&used);
    let_pass(SILENCE);
    assert_eq!(state(&machine), "active");
    // It is not followed under control even when the other has ended.
    peer.kill();
    daemon.says("stopping: setpoint lost in motion");
    daemon.says("fault: setpoint lost in motion");
    let x = pose(&machine)[3];
    assert!((x - 1.1).abs() < 0.01, "it was followed to {x}");
    clear(&machine);
    engage(&machine);
    does(&machine, "stop", &[], &["standby"]);
    let third = publish(&machine, far);
    let_pass(SILENCE);
    is_refused(&machine, "engage", &[], "two sources of setpoints");
    drop((second, third));
    daemon.stops();
    plant.stops();
}

/// It is silent, and applies the same forces as the other when it goes on.
#[test]
#[apply(beside_others)]
fn control_does_not_begin_beside_a_stopped_driver() {
    let Controlled { peer: _peer, daemon, plant, machine } =
        Controlled::start(Machine::patient("stopped-driver"));
    let lengths = lengths_of(&machine, 0.0);
    plant.hold();
    daemon.says("fault: measurement lost");
    clear(&machine);
    machine.hexad::<&str>("plant", &[]).fails(2, "stopped by SIGSTOP");
    machine.hexad("status", &[""; 0]).succeeds().find("STOPPED").expect("it is shown");
    is_refused(&machine, "engage", &[], "no measurements come from process");
    let second = publish(&machine, lengths);
    let_pass(SILENCE);
    is_refused(&machine, "engage", &[], &format!("only kill -KILL {} ends it", plant.id()));
    plant.signal("KILL");
    let end = || machine.hexad("engage", &["--within", "1"]).stderr;
    plant.waits(|| !end().contains("two sources of measurements"), "count as one that has ended");
    drop(second);
    daemon.stops();
}

#[test]
#[apply(beside_others)]
fn a_plant_does_not_join_where_a_driver_lives() {
    let machine = Machine::patient("plant-beside");
    let daemon = start_daemon(&machine);
    let driver = publish(&machine, MeasuredMessage::default());
    let end = format!(") already publishes measurements of {}: end it first", machine.name);
    let stderr = machine.hexad::<&str>("plant", &[]).fails(2, &end);
    assert!(stderr.contains(&format!("process {} (", process::id())), "{stderr}");
    drop(driver);
    let plant = crate::support::trio::start_plant(&machine);
    plant.says("plant at rest at home");
    plant.stops();
    daemon.stops();
}
