//! `hexad move`: never waits silently, ends with an operator's request, and comes to rest under control on a signal.

use std::thread::sleep;
use std::time::Duration;

use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;

use crate::support::children::Hexad;
use crate::support::machine::Machine;
use crate::support::operator::{clear, does, is_refused};
use crate::support::recorder::Recorder;
use crate::support::socket::{state, status};
use crate::support::trio::{Trio, fastest, let_pass, player_ended, start_daemon, start_plant, valid_after};

const SHORT: [&str; 4] = ["--motion", "sines", "--seconds", "1"];
const ENGAGES: [&str; 3] = ["--engage", "--within", "10"];

fn plays_to_its_end(machine: &Machine, more: &[&str]) {
    let ended = machine.hexad("move", &[&SHORT, more].concat());
    assert!(ended.stderr.contains("the daemon is in control: moving"), "{}", ended.stderr);
    ended.succeeds();
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_move_takes_control_after_whatever_was_before_or_says_why_not() {
    let machine = Machine::patient("again");
    let daemon = start_daemon(&machine);
    let soon = ["--engage", "--motion", "sines", "--within", "1"];
    let unknown = "hexad: not engaged within 1 s: the pose of the platform is unknown: no measurement";
    machine.hexad("move", &soon).fails(1, unknown);
    let plant = start_plant(&machine);
    daemon.says("standby: no setpoint");
    plays_to_its_end(&machine, &ENGAGES);
    plays_to_its_end(&machine, &ENGAGES);
    // The platform follows its stop when `park` is requested.
    for request in ["off", "park"] {
        does(&machine, request, &[], &["off"]);
        plays_to_its_end(&machine, &ENGAGES);
    }
    does(&machine, "estop", &[], &["fault"]);
    let words = "hexad: engage was refused: not possible in state fault (emergency stop); hexad clear first";
    machine.hexad("move", &soon).fails(1, words);
    clear(&machine);
    daemon.stops();
    machine.hexad("move", &soon).fails(1, "hexad: not engaged within 1 s: no status of a daemon");
    plant.stops();
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_move_that_took_control_ends_when_control_ends() {
    for (who, words) in [
        ("plant", "hexad: the motion has ended: the daemon is in fault: measurement lost"),
        ("daemon", "hexad: the motion has ended: no status of the daemon any more"),
    ] {
        let motion = ["--engage", "--motion", "sines", "--seconds", "40"];
        let mut trio = Trio::standing(Machine::patient(&format!("ends_{who}")));
        let player = Hexad::start(&trio.machine, "move", &motion);
        trio.moves_after(0);
        if who == "plant" {
            trio.plant.kill()
        } else {
            trio.daemon.kill()
        }
        player.ends().fails(1, words);
    }
}

#[test]
#[apply(beside_others)]
fn a_signal_brings_the_platform_to_rest_under_control() {
    let mut trio = Trio::in_motion("interrupted");
    trio.setpoints().signal("INT");
    // A host that takes the processor from the plant, longer than the setpoints go on: "stands" is said when it does.
    trio.plant.hold();
    sleep(Duration::from_millis(270));
    trio.plant.signal("CONT");
    let stderr = trio.setpoints.take().expect("a player").ends().fails(130, "hexad: interrupted");
    for words in [
        "slowing down along the path, within ",
        "the platform stands under control; hexad stop or park ends it",
    ] {
        assert!(stderr.contains(words), "{words:?} must be in {stderr}");
    }
    let during @ (_, to_ns) = let_pass(Duration::from_secs(1));
    assert_eq!(state(&trio.machine), "active", "longer than any timeout after its source has left");
    trio.recorder.until("forces are valid", |recording| {
        recording.forces.last().filter(|force| valid_after(force, to_ns)).map(drop)
    });
    does(&trio.machine, "stop", &[], &["standby"]);
    let recording = trio.finish();
    recording.has_no_fault();
    recording.stands(during);
}

#[test]
#[apply(beside_others)]
fn after_a_stop_the_player_has_ended_and_an_engage_moves_nothing() {
    let mut trio = Trio::in_motion("ended");
    does(&trio.machine, "stop", &[], &["standby"]);
    trio.setpoints.take().into_iter().for_each(player_ended);
    let from_ns = monotonic_ns();
    trio.recorder.until("the setpoints are too old", |recording| {
        let last_ns = recording.setpoints.last()?.header.time_ns;
        (monotonic_ns() > last_ns + 600_000_000).then_some(())
    });
    is_refused(&trio.machine, "engage", &[], "engage was refused: setpoint");
    assert!(!trio.finish().forces.iter().any(|force| valid_after(force, from_ns)));
}

/// Without `--engage` it waits for somebody to engage, and says so.
#[test]
fn a_move_without_a_daemon_says_what_it_waits_for() {
    let machine = Machine::patient("alone");
    let recorder = Recorder::start(&machine.name);
    let setpoints = crate::support::trio::start_setpoints(&machine);
    setpoints.says("waiting: no status of a daemon");
    let daemon = start_daemon(&machine);
    setpoints.says("waiting: the pose of the platform is unknown: no measurement");
    let plant = start_plant(&machine);
    setpoints.says("waiting for control (hexad engage)");
    setpoints.interrupted_on("INT");
    drop((daemon, plant, recorder));
}

#[test]
#[apply(beside_others)]
fn a_player_waits_while_another_source_is_followed() {
    let trio = Trio::in_motion("second-player");
    let second = Hexad::start(&trio.machine, "move", &["--motion", "sines", "--engage", "--within", "2"]);
    const WORDS: &str = "(hexad) publishes setpoints; end it first";
    second.says(WORDS);
    second.ends().fails(
        1,
        &format!(
            "hexad: not engaged within 2 s: process {} {WORDS}",
            trio.setpoints.as_ref().expect("one").id()
        ),
    );
    trio.moves_after(monotonic_ns());
    trio.finish();
}

/// A target that is held has no source any more: a player begins there, without a stop.
#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_player_takes_over_a_platform_that_is_held() {
    let trio = Trio::standing(Machine::patient("takes-over"));
    let machine = &trio.machine;
    let goes = || drop(machine.hexad("goto", &["--engage", "--x", "1110mm"]).succeeds());
    goes();
    // The source that holds the target lives.
    let holding = Hexad::start(machine, "hold", &["--engage"]);
    let is_listed = |all: &serde_json::Value| {
        all.as_array().is_some_and(|all| all.iter().any(|it| it["process_id"] == holding.id()))
    };
    trio.recorder.until("the source is listed", |_| {
        is_listed(&status(machine)["status"]["sources"][0]["processes"]).then_some(())
    });
    let waiting = Hexad::start(machine, "move", &SHORT);
    waiting.says(&format!("waiting: process {} (hexad) publishes setpoints; end it first", holding.id()));
    drop(holding);
    waiting.says("the daemon is in control: moving");
    waiting.ends().succeeds();
    does(machine, "stop", &[], &["standby"]);
    goes();
    machine.hexad("move", &[&SHORT[..], &["--hold"]].concat()).succeeds();
    // Longer than any timeout after its source has left.
    let_pass(Duration::from_secs(1));
    assert_eq!((&*state(machine), &status(machine)["status"]["in_position"]), ("active", &true.into()));
    machine.hexad("move", &SHORT).succeeds();
    trio.is_in(State::Standby);
    let recording = trio.finish();
    let moved = recording.measured.iter().map(fastest).fold(0.0, f64::max);
    assert!(moved > 0.1, "the motion was not followed: {moved} m/s");
    recording.has_no_fault();
}
