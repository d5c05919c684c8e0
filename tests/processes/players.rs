//! `hexad move`: never waits silently, ends with an operator's request, and comes to rest under control on a signal.

use std::time::Duration;

use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;

use crate::support::children::{Ended, HANG, Hexad, run};
use crate::support::machine::Machine;
use crate::support::operator::{clear, does, is_refused};
use crate::support::recorder::Recorder;
use crate::support::rules;
use crate::support::socket::status;
use crate::support::trio::{Trio, fastest, let_pass, player_ended, start_daemon, start_plant, valid_after};
use crate::support::turns;

/// A short motion that takes control.
fn plays(machine: &Machine) -> Ended {
    let file = machine.file.display().to_string();
    run(
        machine,
        &["move", "--engage", "--motion", "sines", "--seconds", "1", "--within", "10", "--config", &file],
    )
}

fn plays_to_its_end(machine: &Machine, after: &str) {
    let Ended { status, stderr, .. } = plays(machine);
    assert_eq!(status.code(), Some(0), "after {after}: {stderr}");
    assert!(stderr.contains("the daemon is in control: moving"), "after {after}: {stderr}");
}

#[test]
fn a_move_takes_control_after_whatever_was_before_or_says_why_not() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("again");
    let daemon = start_daemon(&machine);
    let file = machine.file.display().to_string();
    let short = ["move", "--engage", "--motion", "sines", "--within", "1", "--config", &file];
    let Ended { status, stderr, .. } = run(&machine, &short);
    assert_eq!(status.code(), Some(1), "{stderr}");
    let words = "hexad: not engaged within 1 s: the pose of the platform is unknown: no measurement";
    assert!(stderr.contains(words), "{stderr}");
    let plant = start_plant(&machine);
    daemon.says("standby: no setpoint");
    plays_to_its_end(&machine, "nothing");
    plays_to_its_end(&machine, "another move");
    does(&machine, "off", &[], &["off"]);
    plays_to_its_end(&machine, "off");
    // The platform follows its stop when this is requested.
    does(&machine, "park", &[], &["off"]);
    plays_to_its_end(&machine, "park");
    does(&machine, "estop", &[], &["fault"]);
    let Ended { status, stderr, .. } = plays(&machine);
    assert_eq!(status.code(), Some(1), "{stderr}");
    let words = "hexad: engage was refused: not possible in state fault (emergency stop); hexad clear first";
    assert!(stderr.contains(words), "{stderr}");
    clear(&machine);
    daemon.stops_on("TERM", HANG);
    let Ended { status, stderr, .. } = run(&machine, &short);
    assert_eq!(status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("hexad: not engaged within 1 s: no status of a daemon"), "{stderr}");
    plant.stops_on("TERM", HANG);
}

#[test]
fn a_signal_brings_the_platform_to_rest_under_control() {
    let _turn = turns::beside_others();
    let Trio { setpoints, daemon, plant, recorder, machine } = Trio::in_motion("interrupted");
    let Ended { stderr, .. } = setpoints.interrupted_on("INT", HANG);
    for words in [
        "slowing down along the path, within ",
        "the platform stands under control; hexad stop or park ends it",
    ] {
        assert!(stderr.contains(words), "{words:?} must be in {stderr}");
    }
    let (from_ns, to_ns) = let_pass(Duration::from_secs(1));
    assert_eq!(status(&machine)["state"], "active", "longer than any timeout after its source has left");
    recorder.until("forces are valid", |recording| {
        recording.forces.last().filter(|force| valid_after(force, to_ns)).map(drop)
    });
    does(&machine, "stop", &[], &["standby"]);
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    assert!(recording.forces.iter().all(|force| force.state != State::Fault as u32), "no fault");
    let during =
        recording.measured.iter().filter(|measured| (from_ns..to_ns).contains(&measured.header.time_ns));
    let speed = during.map(fastest).fold(0.0, f64::max);
    assert!(speed < 1e-3, "a leg moves at {speed} m/s while the platform is to stand");
}

#[test]
fn after_a_stop_the_player_has_ended_and_an_engage_moves_nothing() {
    let _turn = turns::beside_others();
    let Trio { setpoints, daemon, plant, recorder, machine } = Trio::in_motion("ended");
    does(&machine, "stop", &[], &["standby"]);
    player_ended(setpoints);
    let from_ns = monotonic_ns();
    recorder.until("the setpoints are too old", |recording| {
        let last_ns = recording.setpoints.last()?.header.time_ns;
        (monotonic_ns() > last_ns + 600_000_000).then_some(())
    });
    is_refused(&machine, "engage", &[], "engage was refused: setpoint");
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    assert!(!recording.forces.iter().any(|force| valid_after(force, from_ns)));
    rules::hold(&recording);
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
    setpoints.interrupted_on("INT", HANG);
    drop((daemon, plant, recorder));
}

#[test]
fn a_player_waits_while_another_source_is_followed() {
    let _turn = turns::beside_others();
    let trio = Trio::in_motion("second-player");
    let file = trio.machine.file.display().to_string();
    let second = Hexad::start(&trio.machine, "move", &["--motion", "sines", "--engage", "--within", "2"]);
    second.says("(hexad) publishes setpoints; end it first");
    let Ended { status, stderr, .. } = second.ends_within(HANG);
    assert_eq!(status.code(), Some(1), "{file}: {stderr}");
    assert!(stderr.contains("(hexad) publishes setpoints; end it first"), "{stderr}");
    trio.moves_after(monotonic_ns());
    trio.finish();
}

/// A target that is held has no source any more: a player begins there, without a stop.
#[test]
fn a_player_takes_over_a_platform_that_is_held() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("takes-over");
    let recorder = Recorder::start(&machine.name);
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    daemon.says("standby: no setpoint");
    let file = machine.file.display().to_string();
    let plays = |more: &[&str]| {
        run(&machine, &[&["move", "--motion", "sines", "--seconds", "1", "--config", &file], more].concat())
    };
    let goes = || {
        let gone = run(&machine, &["goto", "--engage", "--x", "1110mm", "--config", &file]);
        assert_eq!(gone.status.code(), Some(0), "{}", gone.stderr);
    };
    goes();
    // The source that holds the target lives.
    let holding = Hexad::start(&machine, "hold", &["--engage"]);
    let is_listed = |all: &serde_json::Value| {
        all.as_array().is_some_and(|all| all.iter().any(|it| it["process_id"] == holding.id()))
    };
    recorder.until("the source is listed", |_| {
        is_listed(&status(&machine)["status"]["sources"][0]["processes"]).then_some(())
    });
    let waiting = Hexad::start(&machine, "move", &["--motion", "sines", "--seconds", "1"]);
    waiting.says(&format!("waiting: process {} (hexad) publishes setpoints; end it first", holding.id()));
    drop(holding);
    let Ended { status: code, stderr, .. } = waiting.ends_within(HANG);
    assert_eq!(code.code(), Some(0), "{stderr}");
    assert!(stderr.contains("the daemon is in control: moving"), "{stderr}");
    does(&machine, "stop", &[], &["standby"]);
    goes();
    let Ended { status: code, stderr, .. } = plays(&["--hold"]);
    assert_eq!(code.code(), Some(0), "{stderr}");
    // Longer than any timeout after its source has left.
    let_pass(Duration::from_secs(1));
    assert_eq!(
        (&status(&machine)["state"], &status(&machine)["status"]["in_position"]),
        (&"active".into(), &true.into())
    );
    let Ended { status: code, stderr, .. } = plays(&[]);
    assert_eq!(code.code(), Some(0), "{stderr}");
    recorder.until("the motion has ended in standby", |recording| {
        recording.statuses.last().filter(|status| status.state == State::Standby as u32).map(drop)
    });
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    rules::hold(&recording);
    let moved = recording.measured.iter().map(fastest).fold(0.0, f64::max);
    assert!(moved > 0.1, "the motion was not followed: {moved} m/s");
    assert!(recording.forces.iter().all(|force| force.state != State::Fault as u32), "no fault");
}
