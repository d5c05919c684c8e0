//! `hexad reload`: all of the file is taken over, or nothing, and never under control.

use std::fs;
use std::process::Command;
use std::time::Instant;

use serde_json::Value;

use crate::support::children::{HANG, Hexad, hexad};
use crate::support::machine::{Machine, PATIENT};
use crate::support::nobody::{AS_NOBODY, cannot, wrapped};
use crate::support::operator::{ask, does, is_refused, own_name};
use crate::support::peer::Controlled;
use crate::support::socket::{state, status};
use crate::support::trio::start_daemon;

/// Sections of the machine file, each key once.
const SECTIONS: &str = "
[limits]
condition = 90.0
scale = 0.5

[control]
position_bandwidth_hz = 10.0
";

fn machine(test: &str) -> Machine {
    Machine::with(test, &format!("{PATIENT}{SECTIONS}"))
}

/// Replaces words of the machine file.
fn edit(machine: &Machine, pairs: &[(&str, &str)]) {
    let mut text = fs::read_to_string(&machine.file).expect("the machine file");
    for (old, new) in pairs {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    fs::write(&machine.file, text).expect("to write");
}

/// What the status says about the file in force: hash, reloads, and a limit of it.
fn in_force(machine: &Machine) -> (Value, Value, Value) {
    let report = status(machine)["status"].clone();
    let configuration = &report["configuration"];
    (configuration["sha1"].clone(), configuration["reloads"].clone(), report["condition_limit"].clone())
}

fn sha1(machine: &Machine) -> Value {
    let output = Command::new("sha1sum").arg(&machine.file).output().expect("sha1sum");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.split(' ').next().expect("a hash").into()
}

#[test]
#[apply(beside_others)]
fn gains_limits_and_timeouts_are_taken_over_in_standby_and_not_under_control() {
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::start(machine("reload"));
    let before = in_force(&machine);
    assert_eq!(before, (sha1(&machine), 0.into(), 90.0.into()));
    let scale = || status(&machine)["status"]["limits_scale"].clone();
    assert_eq!(scale(), 0.5);
    edit(
        &machine,
        &[
            ("condition = 90.0", "condition = 80.0 # less"),
            ("scale = 0.5", "scale = 0.1"),
            ("= 10.0", "= 8.0"),
            ("setpoint_ms = 400.0", "setpoint_ms = 300.0"),
            ("mass_kg = 3.0", "mass_kg = 3.01"),
            ("max_force_n = 500.0", "max_force_n = 500.0\ncoulomb_friction_n = 0.1"),
        ],
    );
    let words = "reload was refused, nothing has changed:\nnot possible in state active, in which the platform is under \
                 control; hexad stop or park first";
    is_refused(&machine, "reload", &[], words);
    assert_eq!(in_force(&machine), before);
    daemon.says("reload was refused, nothing has changed: not possible in state active");
    does(&machine, "stop", &[], &["standby"]);
    let stdout = ask(&machine, "reload", &[]).succeeds();
    let changes = "on: platform.mass_kg: 3.0 -> 3.01; timeouts.setpoint_ms: 400.0 -> 300.0; limits.condition: 90.0 -> 80.0; \
                   limits.scale: 0.5 -> 0.1; control.position_bandwidth_hz: 10.0 -> 8.0; \
                   actuator.coulomb_friction_n: default -> 0.1\n";
    let file = format!("{}, from cycle ", machine.file.display());
    assert!(stdout.starts_with(&file) && stdout.ends_with(changes), "{stdout}");
    daemon.says(&format!("request: reload user={} process=", own_name()));
    daemon.says(&format!("reload: {file}"));
    assert_eq!(in_force(&machine), (sha1(&machine), 1.into(), 80.0.into()));
    assert_eq!(scale(), 0.1);
    // Once more, without a difference.
    let stdout = ask(&machine, "reload", &[]).succeeds();
    assert!(stdout.ends_with("on: nothing that the daemon reads has changed\n"), "{stdout}");
    does(&machine, "engage", &["--wait"], &["active"]);
    daemon.stops();
    plant.stops();
}

#[test]
#[apply(beside_others)]
fn what_is_wrong_or_needs_a_restart_changes_nothing() {
    let machine = machine("unchanged");
    let daemon = start_daemon(&machine);
    daemon.says("running");
    let (before, text) = (in_force(&machine), fs::read_to_string(&machine.file).expect("the machine file"));
    // One good value, and one that is not valid; the drives cannot hold the platform; what a running daemon cannot change.
    let good = ("condition = 90.0", "condition = 80.0");
    let place = |line: &str| format!("{}:{line}", machine.file.display());
    for (edits, words) in [
        (
            vec![good, ("= 10.0\n", "= -10.0\n")],
            vec![place(""), "control.position_bandwidth_hz = -10.0: must be".into()],
        ),
        (vec![good, ("[limits]", "[limits\n")], vec![place("")]),
        (
            vec![good, ("max_force_n = 500.0", "max_force_n = 15.7")],
            vec!["actuator.max_force_n: 500.0 -> 15.7: needs a restart".into()],
        ),
        (
            vec![
                good,
                ("[limits]", "[realtime]\nrate_hz = 500.0\n[operator]\ngroup = \"root\"\n[limits]"),
                ("max_length_m = 1.6", "max_length_m = 1.5"),
            ],
            [
                "actuator.max_length_m: 1.6 -> 1.5",
                "realtime.rate_hz: default -> 500.0",
                "operator.group: default -> \"root\"",
            ]
            .map(|change| format!("{change}: needs a restart"))
            .into(),
        ),
        // As at the start: the loops are not stable with it.
        (
            vec![good, ("allow_unstable_age = true", "allow_unstable_age = false")],
            vec!["timeouts.measured_ms = 400: must be at most ".into()],
        ),
    ] {
        fs::write(&machine.file, &text).expect("to write");
        edit(&machine, &edits);
        let ended = ask(&machine, "reload", &[]);
        assert_eq!(ended.stdout, "");
        let stderr = ended.fails(1, "reload was refused, nothing has changed:\n");
        for words in words {
            assert!(stderr.contains(&words), "{words} must be in {stderr}");
        }
        assert_eq!(in_force(&machine), before, "{edits:?}");
    }
    fs::remove_file(&machine.file).expect("to remove");
    fs::write(machine.path("name.toml"), &text).expect("to write");
    let mut command = hexad();
    command.args(["reload", "--config"]).arg(machine.path("name.toml"));
    // The daemon reads its own file. A mistake in it keeps nobody from stopping.
    Hexad::spawn(&machine, "reload", command).ends().fails(1, "machine.toml: could not be read");
    fs::write(&machine.file, text.replace("= 10.0\n", "= -10.0\n")).expect("to write");
    does(&machine, "off", &[], &["off"]);
    does(&machine, "estop", &[], &["fault"]);
    assert_eq!(state(&machine), "fault");
    daemon.stops();
}

#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn another_user_may_not_reload() {
    if cannot(&[AS_NOBODY]) {
        return;
    }
    let machine = machine("foreign");
    let daemon = start_daemon(&machine);
    daemon.says("running");
    edit(&machine, &[("condition = 90.0", "condition = 80.0")]);
    let mut command = wrapped(&machine, &[AS_NOBODY]);
    command.args(["reload", "--config"]).arg(&machine.file);
    Hexad::spawn(&machine, "reload", command).ends().fails(2, "this user may not send requests for ");
    assert_eq!(in_force(&machine).2, 90.0);
    daemon.stops();
}

/// As a service; by hand SIGHUP ends the daemon, as the terminal is closed.
#[test]
#[apply(beside_others)]
fn a_hangup_reloads() {
    let machine = machine("hangup");
    let mut command = hexad();
    command.args(["run", "--config"]).arg(&machine.file).env("NOTIFY_SOCKET", machine.path("nobody"));
    let daemon = Hexad::spawn(&machine, "run", command);
    daemon.says("running");
    edit(&machine, &[("condition = 90.0", "condition = 80.0")]);
    daemon.signal("HUP");
    daemon.says("limits.condition: 90.0 -> 80.0");
    // The status follows when the control thread next looks.
    let began = Instant::now();
    while in_force(&machine) != (sha1(&machine), 1.into(), 80.0.into()) {
        assert!(began.elapsed() < HANG, "{:?}", in_force(&machine));
    }
    daemon.stops();
}
