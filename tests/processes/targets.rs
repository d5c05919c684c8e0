//! `hexad goto`, `hold` and `jog`: refused before anything moves, within the limits on the way, and under control afterwards.

use std::io::Write;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::commands::demo::children::PARENT_VARIABLE;
use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;

use crate::support::children::{Ended, HANG, Hexad, run};
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::does;
use crate::support::recorder::Recorder;
use crate::support::rules;
use crate::support::socket::status;
use crate::support::trio::{Trio, fastest, let_pass, start_daemon, start_plant};
use crate::support::turns;

/// Targets slow enough to be interrupted: 2 % of the limits.
const SLOW: &str = "\n[limits]\nautonomous_scale = 0.02\n";

/// A leg faster than this is in motion \[m/s\].
const IN_MOTION: f64 = 0.004;

/// Distance from a target that counts as there \[m\], \[rad\]: that of the estimator of an exact model is less.
const THERE: f64 = 1e-4;

fn goto(machine: &Machine, more: &[&str]) -> Ended {
    let file = machine.file.display().to_string();
    run(machine, &[&["goto", "--config", &file], more].concat())
}

/// X of the platform, by the daemon.
fn pose(machine: &Machine) -> [f64; 6] {
    let answer = status(machine);
    let pose = &answer["status"]["pose"];
    core::array::from_fn(|k| pose[k].as_f64().unwrap_or(f64::NAN))
}

fn is_at(machine: &Machine, axis: usize, value: f64) {
    let x = pose(machine);
    assert!((x[axis] - value).abs() < THERE, "coordinate {axis} is not {value}: {x:?}");
}

#[test]
fn a_goto_is_refused_before_anything_moves_or_leaves_the_platform_standing() {
    let _turn = turns::beside_others();
    let machine = Machine::with("goto", &format!("{PATIENT}{SLOW}"));
    let recorder = Recorder::start(&machine.name);
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    daemon.says("standby: no setpoint");
    let refusals: [(&[&str], i32, &str); 7] = [
        (
            &["--relative", "--z", "900mm"],
            2,
            "outside of the workspace: leg 4: length 1.7708 m, bound 1.5963 m",
        ),
        (&["--relative", "--x", "0.04m"], 1, "not under control (state standby: no setpoint"),
        (&[], 2, "no target: give coordinates"),
        (&["--x", "5"], 2, "invalid value '5' for '--x <LENGTH>': has no unit: say 5mm or 5m"),
        (&["--alpha", "-0.1"], 2, "has no unit: say -0.1deg or -0.1rad"),
        (&["--gamma", "5mm"], 2, "must be an angle in rad, mrad, urad, deg, arcmin, arcsec"),
        (&["--x-mm", "5"], 2, "--x-mm has no unit in its name any more, its value has one: --x 5mm"),
    ];
    for (more, code, words) in refusals {
        let Ended { status, stderr, .. } = goto(&machine, more);
        assert_eq!(status.code(), Some(code), "{more:?}: {stderr}");
        assert!(stderr.contains(words), "{words:?} must be in {stderr}");
    }
    let began_ns = monotonic_ns();
    let Ended { status: code, stdout, stderr } =
        goto(&machine, &["--relative", "--x", "40mm", "--gamma", "4deg", "--engage"]);
    assert_eq!(code.code(), Some(0), "{stderr}");
    assert!(stdout.contains("in position after ") && stdout.contains("stands under control"), "{stdout}");
    // Longer than any timeout after its source has left.
    let_pass(Duration::from_secs(1));
    assert_eq!(status(&machine)["state"], "active");
    is_at(&machine, 3, 1.14);
    is_at(&machine, 2, 4.0_f64.to_radians());
    let going = Hexad::start(&machine, "goto", &["--relative", "--z", "100mm", "--speed", "50%"]);
    recorder.until("the platform moves", |recording| {
        recording.measured.last().filter(|measured| fastest(measured) > IN_MOTION).map(drop)
    });
    let Ended { stderr, .. } = going.interrupted_on("INT", HANG);
    assert!(stderr.contains("the platform stands under control; hexad stop or park ends it"), "{stderr}");
    let (from_ns, to_ns) = let_pass(Duration::from_secs(1));
    assert_eq!(status(&machine)["state"], "active");
    let x = pose(&machine);
    assert!(x[5] > 0.0 && x[5] < 0.099, "interrupted on the way: {x:?}");
    assert_eq!(goto(&machine, &["--home"]).status.code(), Some(0));
    is_at(&machine, 3, 1.1);
    is_at(&machine, 5, 0.0);
    does(&machine, "stop", &[], &["standby"]);
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    rules::hold(&recording);
    assert!(recording.setpoints.iter().all(|setpoint| setpoint.header.time_ns > began_ns), "after a refusal");
    assert!(recording.forces.iter().all(|force| force.state != State::Fault as u32), "no fault");
    let during =
        recording.measured.iter().filter(|measured| (from_ns..to_ns).contains(&measured.header.time_ns));
    let speed = during.map(fastest).fold(0.0, f64::max);
    assert!(speed < 1e-3, "a leg moves at {speed} m/s while the platform is to stand");
}

/// Steps smaller than what counts as reached, of a machine whose legs stick: each is added to the target, not to where
/// the reference or the platform is.
#[test]
fn relative_steps_add_up() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("steps");
    let text = include_str!("../data/mirror_stiction.toml");
    let named = text.replace("name = \"mirror_stiction\"", &format!("name = \"{}\"", machine.name));
    std::fs::write(&machine.file, named).expect("a machine file");
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    daemon.says("standby: no setpoint");
    let goes = |more: &[&str]| {
        let Ended { status, stderr, .. } = goto(&machine, more);
        assert_eq!(status.code(), Some(0), "{more:?}: {stderr}");
    };
    goes(&["--home", "--engage"]);
    let home = status(&machine)["status"]["target"][5].as_f64().expect("a target");
    (0..15).for_each(|_| goes(&["--relative", "--z", "2um"]));
    let_pass(Duration::from_secs(2));
    let target = status(&machine)["status"]["target"][5].as_f64().expect("a target");
    assert!((target - home - 30e-6).abs() < 1e-12, "{home} {target}");
    let z = pose(&machine)[5];
    assert!((z - target).abs() < 1e-6, "{z} is not {target}");
    assert_eq!(status(&machine)["status"]["in_position"], true);
    // Legs that stick do not come to within an atom.
    let Ended { status: code, stderr, .. } =
        goto(&machine, &["--relative", "--z", "0.1mm", "--tolerance", "1nm"]);
    let words = "the reference has reached the target, but the platform was not in position";
    assert!(
        code.code() == Some(1) && stderr.contains(words) && stderr.contains("tolerance 1.00e-6 mm"),
        "{stderr}"
    );
    does(&machine, "stop", &[], &["standby"]);
    assert!(status(&machine)["status"]["target"].is_null(), "without control there is no target");
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
}

#[test]
fn a_dry_run_needs_no_daemon() {
    let machine = Machine::patient("dry-run");
    let Ended { status, stdout, stderr } = goto(
        &machine,
        &["--relative", "--x", "50mm", "--y=-5mm", "--z", "-3um", "--gamma", "100mrad", "--dry-run"],
    );
    assert_eq!(status.code(), Some(0), "{stderr}");
    for words in [
        "from is home, as no daemon answers",
        "1150.000",
        "-5.000",
        "-0.003",
        "5.7296",
        "limited by velocity",
    ] {
        assert!(stdout.contains(words), "{words}: {stdout}");
    }
    let duration = stdout.lines().find_map(|line| line.strip_prefix("duration  ")).expect("a duration");
    let duration_s: f64 = duration.split(' ').next().and_then(|text| text.parse().ok()).expect("a number");
    // 50 mm at a fifth of 1 m/s, 5 m/s^2 and 100 m/s^3: at least d / v + v / a + a / j = 0.46 s.
    assert!(duration_s > 0.45 && duration_s < 1.2 * 0.46 + 0.1, "{duration}");
}

/// Steps of a machine with a stroke of 0.1 mm, and of one with 28 mm, have digits on the screen.
#[test]
fn a_small_step_is_seen() {
    let machine = Machine::patient("digits");
    for (name, alpha, z) in [("piezo", "0.000833", "135.005000"), ("telescope_m2", "0.00083", "-702.9950")] {
        let file = format!("{}/tests/data/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let step = ["goto", "--config", &file, "--relative", "--z", "5um", "--alpha", "3arcsec", "--dry-run"];
        let Ended { status, stdout, stderr } = run(&machine, &step);
        assert_eq!(status.code(), Some(0), "{stderr}");
        let to = stdout.lines().find(|line| line.starts_with("to ")).expect("a target");
        let to: Vec<_> = to.split_whitespace().collect();
        assert_eq!([to[1], to[6]], [alpha, z], "{name}: {stdout}");
    }
}

#[test]
fn a_slower_goto_takes_longer() {
    let machine = Machine::patient("speed");
    let seconds = |speed: &str| -> f64 {
        let ended = goto(&machine, &["--relative", "--x", "100mm", "--dry-run", "--speed", speed]);
        assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
        let duration =
            ended.stdout.lines().find_map(|line| line.strip_prefix("duration  ")).expect("a duration");
        duration.split(' ').next().and_then(|text| text.parse().ok()).expect("a number")
    };
    let [whole, half] = [seconds("100%"), seconds("0.5")];
    // d / v + v / a + a / j, with 0.2 m/s: half of the speed doubles the first.
    assert!((half - whole - 0.5).abs() < 0.02, "{whole} s and {half} s");
    for (speed, words) in
        [("0", "must be in [0.01, 1]"), ("200%", "must be in [1, 100] %"), ("fast", "must be a number")]
    {
        let ended = goto(&machine, &["--home", "--dry-run", "--speed", speed]);
        assert_eq!(ended.status.code(), Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains(words), "{words}: {}", ended.stderr);
    }
}

#[test]
fn a_hold_ends_with_a_stop() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("hold");
    let recorder = Recorder::start(&machine.name);
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    daemon.says("standby: no setpoint");
    let hold = Hexad::start(&machine, "hold", &["--engage"]);
    recorder.until("the platform is under control", |recording| {
        recording.statuses.last().filter(|status| status.state == State::Active as u32).map(drop)
    });
    // It is the source that counts, as long as it runs.
    let Ended { status: code, stderr, .. } = goto(&machine, &["--relative", "--x", "10mm"]);
    assert_eq!(code.code(), Some(1), "{stderr}");
    assert!(
        stderr.contains(&format!("a hold of process {} is in progress; end it first", hold.id())),
        "{stderr}"
    );
    is_at(&machine, 3, 1.1);
    // By then it has noticed it, too.
    let_pass(Duration::from_millis(500));
    let Ended { stdout, .. } = hold.stops_on("INT", HANG);
    assert_eq!(stdout, "the platform stands under control; Ctrl-C ends it with a stop\nstandby\n");
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    rules::hold(&recording);
    assert!(recording.forces.iter().all(|force| force.state != State::Fault as u32), "no fault");
}

#[test]
fn a_player_pauses_and_goes_on_along_its_path() {
    let _turn = turns::beside_others();
    let trio = Trio::in_motion("pause");
    let file = trio.machine.file.display().to_string();
    let paused = run(&trio.machine, &["move", "--pause", "--config", &file]);
    assert_eq!(paused.status.code(), Some(0), "{}", paused.stderr);
    assert!(paused.stderr.contains("is paused; hexad move --resume goes on"), "{}", paused.stderr);
    trio.setpoints.says("slowing down along the path, within ");
    let (from_ns, to_ns) = let_pass(Duration::from_secs(1));
    assert_eq!(status(&trio.machine)["state"], "active");
    let resumed = run(&trio.machine, &["move", "--resume", "--config", &file]);
    assert_eq!(resumed.status.code(), Some(0), "{}", resumed.stderr);
    trio.moves_after(monotonic_ns());
    assert_eq!(status(&trio.machine)["state"], "active");
    let recording = trio.finish();
    assert!(recording.forces.iter().all(|force| force.state != State::Fault as u32), "no fault");
    let during =
        recording.measured.iter().filter(|measured| (from_ns..to_ns).contains(&measured.header.time_ns));
    let speed = during.map(fastest).fold(0.0, f64::max);
    assert!(speed < 1e-3, "a leg moves at {speed} m/s during the pause");
}

#[test]
fn a_pause_without_a_player_signals_nobody() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("no-player");
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    daemon.says("standby: no setpoint");
    let file = machine.file.display().to_string();
    let pause = || run(&machine, &["move", "--pause", "--config", &file]);
    let Ended { status, stderr, .. } = pause();
    assert_eq!(status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("no player to pause or resume: no process publishes setpoints"), "{stderr}");
    let hold = Hexad::start(&machine, "hold", &["--engage"]);
    daemon.says("active");
    let Ended { status, stderr, .. } = pause();
    assert_eq!(status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("publishes setpoints and is no hexad move"), "{stderr}");
    hold.stops_on("INT", HANG);
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
}

/// In a pseudo-terminal, which `script` makes.
#[test]
fn a_jog_moves_while_keys_arrive_and_no_longer() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("jog");
    let recorder = Recorder::start(&machine.name);
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    daemon.says("standby: no setpoint");
    let Ended { status: code, stderr, .. } =
        run(&machine, &["jog", "--config", &machine.file.display().to_string()]);
    assert_eq!(code.code(), Some(2), "{stderr}");
    assert!(stderr.contains("must be a terminal"), "{stderr}");
    // In place of the shell, which would else receive Ctrl-C too, and some shells then end with a code of their own.
    let line =
        format!("exec {} jog --engage --config {}", env!("CARGO_BIN_EXE_hexad"), machine.file.display());
    let mut script = Command::new("script");
    script.args(["-qec", &line, "/dev/null"]).env("SHELL", "/bin/sh").env_remove(PARENT_VARIABLE);
    let child = script.stdin(Stdio::piped()).stdout(Stdio::null()).spawn();
    let Ok(mut child) = child else {
        crate::common::not_run::lacking("script");
        return;
    };
    let mut keys = child.stdin.take().expect("standard input");
    recorder.until("the platform is under control", |recording| {
        recording.statuses.last().filter(|status| status.state == State::Active as u32).map(drop)
    });
    let began = Instant::now();
    while pose(&machine)[5] < 0.01 {
        assert!(began.elapsed() < HANG, "the platform does not move up: {:?}", pose(&machine));
        keys.write_all(b"r").expect("a key");
        keys.flush().expect("a key");
        sleep(Duration::from_millis(20));
    }
    let_pass(Duration::from_millis(1500));
    let (from_ns, to_ns) = let_pass(Duration::from_secs(1));
    let x = pose(&machine);
    assert!(x[5] >= 0.01 && x[5] < 0.06, "{x:?}");
    keys.write_all(b"q").expect("a key");
    keys.flush().expect("a key");
    let ended = child.wait().expect("its end");
    assert_eq!(ended.code(), Some(0), "of jog");
    let_pass(Duration::from_secs(1));
    assert_eq!(status(&machine)["state"], "active");
    does(&machine, "stop", &[], &["standby"]);
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    rules::hold(&recording);
    let during =
        recording.measured.iter().filter(|measured| (from_ns..to_ns).contains(&measured.header.time_ns));
    let speed = during.map(fastest).fold(0.0, f64::max);
    assert!(speed < 1e-3, "a leg moves at {speed} m/s without keys");
}
