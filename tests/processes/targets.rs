//! `hexad goto`, `hold` and `jog`: refused before anything moves, within the limits on the way, and under control afterwards.

use std::io::Write;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::commands::demo::children::PARENT_VARIABLE;
use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;

use crate::support::children::{HANG, Hexad};
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::does;
use crate::support::socket::{pose, state, status};
use crate::support::trio::{Trio, fastest, let_pass};

/// Targets slow enough to be interrupted: 2 % of the limits.
const SLOW: &str = "\n[limits]\nautonomous_scale = 0.02\n";

/// A leg faster than this is in motion \[m/s\].
const IN_MOTION: f64 = 0.004;

/// Distance from a target that counts as there \[m\], \[rad\]: that of the estimator of an exact model is less.
const THERE: f64 = 1e-4;

fn is_at(machine: &Machine, axis: usize, value: f64) {
    let x = pose(machine);
    assert!((x[axis] - value).abs() < THERE, "coordinate {axis} is not {value}: {x:?}");
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_goto_is_refused_before_anything_moves_or_leaves_the_platform_standing() {
    let trio = Trio::standing(Machine::with("goto", &format!("{PATIENT}{SLOW}")));
    let machine = &trio.machine;
    let refusals: [(&[&str], i32, &str); 2] = [
        (
            &["--relative", "--z", "900mm"],
            2,
            "outside of the workspace: leg 4: length 1.7708 m, bound 1.5963 m",
        ),
        (&["--relative", "--x", "0.04m"], 1, "not under control (state standby: no setpoint"),
    ];
    for (more, code, words) in refusals {
        machine.hexad("goto", more).fails(code, words);
    }
    let began_ns = monotonic_ns();
    let said =
        machine.hexad("goto", &["--relative", "--x", "40mm", "--gamma", "4deg", "--engage"]).succeeds();
    assert!(said.contains("in position after ") && said.contains("stands under control"), "{said}");
    // Longer than any timeout after its source has left.
    let_pass(Duration::from_secs(1));
    assert_eq!(state(machine), "active");
    is_at(machine, 3, 1.14);
    is_at(machine, 2, 4.0_f64.to_radians());
    let going = Hexad::start(machine, "goto", &["--relative", "--z", "100mm", "--speed", "50%"]);
    trio.recorder.until("the platform moves", |recording| {
        recording.measured.last().filter(|measured| fastest(measured) > IN_MOTION).map(drop)
    });
    let stderr = going.interrupted_on("INT");
    assert!(stderr.contains("the platform stands under control; hexad stop or park ends it"), "{stderr}");
    let during = let_pass(Duration::from_secs(1));
    assert_eq!(state(machine), "active");
    let x = pose(machine);
    assert!(x[5] > 0.0 && x[5] < 0.099, "interrupted on the way: {x:?}");
    machine.hexad("goto", &["--home"]).succeeds();
    is_at(machine, 3, 1.1);
    is_at(machine, 5, 0.0);
    does(machine, "stop", &[], &["standby"]);
    let recording = trio.finish();
    assert!(recording.setpoints.iter().all(|setpoint| setpoint.header.time_ns > began_ns), "after a refusal");
    recording.has_no_fault();
    recording.stands(during);
}

/// Steps smaller than what counts as reached, of a machine whose legs stick: each is added to the target, not to where
/// the reference or the platform is.
#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn relative_steps_add_up() {
    let machine = Machine::patient("steps");
    let text = include_str!("../data/mirror_stiction.toml");
    let named = text.replace("name = \"mirror_stiction\"", &format!("name = \"{}\"", machine.name));
    std::fs::write(&machine.file, named).expect("a machine file");
    let trio = Trio::standing(machine);
    let machine = &trio.machine;
    machine.hexad("goto", &["--home", "--engage"]).succeeds();
    let target = || status(machine)["status"]["target"][5].as_f64().expect("a target");
    let home = target();
    (0..15).for_each(|_| drop(machine.hexad("goto", &["--relative", "--z", "2um"]).succeeds()));
    let_pass(Duration::from_secs(2));
    let target = target();
    assert!((target - home - 30e-6).abs() < 1e-12, "{home} {target}");
    let z = pose(machine)[5];
    assert!((z - target).abs() < 1e-6, "{z} is not {target}");
    assert_eq!(status(machine)["status"]["in_position"], true);
    // Legs that stick do not come to within an atom.
    let words = "the reference has reached the target, but the platform was not in position";
    let stderr = machine.hexad("goto", &["--relative", "--z", "0.1mm", "--tolerance", "1nm"]).fails(1, words);
    assert!(stderr.contains("tolerance 1.00e-6 mm"), "{stderr}");
    does(machine, "stop", &[], &["standby"]);
    assert!(status(machine)["status"]["target"].is_null(), "without control there is no target");
    // The file's own timeouts are shorter than those of the rules.
    trio.daemon.stops();
    trio.plant.stops();
}

#[test]
#[apply(beside_others)]
fn a_hold_counts_while_it_runs_and_ends_with_a_stop() {
    let trio = Trio::standing(Machine::patient("hold"));
    let machine = &trio.machine;
    let pauses = |words: &str| drop(machine.hexad("move", &["--pause"]).fails(1, words));
    pauses("no player to pause or resume: no process publishes setpoints");
    let hold = Hexad::start(machine, "hold", &["--engage"]);
    trio.is_in(State::Active);
    let words = format!("a hold of process {} is in progress; end it first", hold.id());
    machine.hexad("goto", &["--relative", "--x", "10mm"]).fails(1, &words);
    is_at(machine, 3, 1.1);
    // By then it has noticed it, too.
    let_pass(Duration::from_millis(500));
    pauses("publishes setpoints and is no hexad move");
    let stdout = hold.stops_on("INT", HANG).stdout;
    assert_eq!(stdout, "the platform stands under control; Ctrl-C ends it with a stop\nstandby\n");
    trio.finish().has_no_fault();
}

#[test]
#[apply(beside_others)]
fn a_player_pauses_and_goes_on_along_its_path() {
    let mut trio = Trio::in_motion("pause");
    let paused = trio.machine.hexad("move", &["--pause"]);
    assert!(paused.stderr.contains("is paused; hexad move --resume goes on"), "{}", paused.stderr);
    paused.succeeds();
    trio.setpoints().says("slowing down along the path, within ");
    let during = let_pass(Duration::from_secs(1));
    assert_eq!(state(&trio.machine), "active");
    trio.machine.hexad("move", &["--resume"]).succeeds();
    trio.moves_after(monotonic_ns());
    assert_eq!(state(&trio.machine), "active");
    let recording = trio.finish();
    recording.has_no_fault();
    recording.stands(during);
}

/// In a pseudo-terminal, which `script` makes.
#[test]
#[apply(beside_others)]
fn a_jog_moves_while_keys_arrive_and_no_longer() {
    let trio = Trio::standing(Machine::patient("jog"));
    let machine = &trio.machine;
    // In place of the shell, which would else receive Ctrl-C too, and some shells then end with a code of their own.
    let line =
        format!("exec '{}' jog --engage --config '{}'", env!("CARGO_BIN_EXE_hexad"), machine.file.display());
    let mut script = Command::new("script");
    script.args(["-qec", &line, "/dev/null"]).env("SHELL", "/bin/sh").env_remove(PARENT_VARIABLE);
    script.stdin(Stdio::piped());
    let mut jog = Hexad::spawn(machine, "jog", script);
    let mut keys = jog.input();
    let mut press = |key: &[u8]| keys.write_all(key).and_then(|()| keys.flush()).expect("a key");
    trio.is_in(State::Active);
    let began = Instant::now();
    while pose(machine)[5] < 0.01 {
        assert!(began.elapsed() < HANG, "the platform does not move up: {:?}", pose(machine));
        press(b"r");
        sleep(Duration::from_millis(20));
    }
    let_pass(Duration::from_millis(1500));
    let during = let_pass(Duration::from_secs(1));
    let x = pose(machine);
    assert!(x[5] >= 0.01 && x[5] < 0.06, "{x:?}");
    press(b"q");
    jog.ends().succeeds();
    let_pass(Duration::from_secs(1));
    assert_eq!(state(machine), "active");
    does(machine, "stop", &[], &["standby"]);
    trio.finish().stands(during);
}
