//! A machine that must not be run: check, demonstration and daemon refuse it with the same sentence. What they print for programs.

use hexad::config::Config;
use serde_json::Value;

use crate::support::children::{Ended, HANG, Hexad, run};
use crate::support::machine::Machine;
use crate::support::recorder::Recorder;

/// The machine of the paper with drives that are too weak to hold it.
fn weak(test: &str) -> Machine {
    let machine = Machine::patient(test);
    let text = std::fs::read_to_string(&machine.file).expect("the machine file");
    assert!(text.contains("max_force_n = 500.0"));
    std::fs::write(&machine.file, text.replace("max_force_n = 500.0", "max_force_n = 15.7"))
        .expect("to write");
    machine
}

fn hexad(machine: &Machine, command: &str, more: &[&str]) -> Ended {
    let file = machine.file.display().to_string();
    let arguments: Vec<&str> = [command, "--config", &file].into_iter().chain(more.iter().copied()).collect();
    run(machine, &arguments)
}

fn json(ended: &Ended) -> Value {
    serde_json::from_str(&ended.stdout).unwrap_or_else(|error| panic!("{error}: {}", ended.stdout))
}

#[test]
fn drives_too_weak_to_hold_the_platform_are_refused_before_anything_moves() {
    let machine = weak("weak");
    // Each leg holds 15.99 N at home.
    let sentence = format!(
        "{}:28: actuator.max_force_n = 15.7: must be at least 18 to hold the platform: leg ",
        machine.file.display()
    );
    for (command, more) in [("check", &[][..]), ("demo", &["--seconds", "1"]), ("run", &[])] {
        let ended = hexad(&machine, command, more);
        assert_eq!(ended.status.code(), Some(2), "{command}: {}", ended.stderr);
        assert!(ended.stderr.contains(&sentence), "{command}: {sentence}\n{}", ended.stderr);
        assert!(ended.stderr.contains("15.98"), "{}", ended.stderr);
    }
    let shown = hexad(&machine, "check", &[]).stdout;
    assert!(shown.contains("NOT VALID, errors: 1") && shown.contains("101.8 %"), "{shown}");
}

#[test]
fn a_timeout_beyond_the_margin_of_the_loop_is_refused() {
    let machine = Machine::with("impatient", "[timeouts]\nmeasured_ms = 200.0\n");
    for command in ["check", "run", "demo"] {
        let ended = hexad(&machine, command, &[]);
        assert_eq!(ended.status.code(), Some(2), "{command}: {}", ended.stderr);
        assert!(ended.stderr.contains("timeouts.measured_ms = 200: must be at most "), "{}", ended.stderr);
    }
}

#[test]
fn check_prints_the_same_as_json() {
    let machine = weak("checked");
    let ended = hexad(&machine, "check", &["--json"]);
    assert_eq!(ended.status.code(), Some(2));
    let found = json(&ended);
    assert_eq!((&found["schema"], &found["machine"]), (&1.into(), &machine.name.clone().into()));
    assert_eq!((&found["is_valid"], found["legs"].as_array().map(Vec::len)), (&false.into(), Some(6)));
    let error = &found["errors"][0];
    assert_eq!((&error["key"], &error["line"]), (&"actuator.max_force_n".into(), &28.into()));
    let sound = json(&hexad(&Machine::patient("sound"), "check", &["--json"]));
    assert_eq!((&sound["is_valid"], &sound["errors"]), (&true.into(), &Value::Array(vec![])));
    let condition = sound["condition"].as_f64().expect("a number");
    assert!((6.0..20.0).contains(&condition), "{condition}: 6 is best");
    assert_eq!(sound["loops"][0]["name"], "position");
}

#[test]
fn advise_and_workspace_print_json() {
    let machine = Machine::patient("advised");
    let advice = json(&hexad(&machine, "advise", &["--json"]));
    let rows = advice["fidelities"].as_array().expect("rows");
    let exact = rows.iter().find(|row| row["fidelity"] == "exact").expect("the exact model");
    assert_eq!((&advice["schema"], &exact["max_n"]), (&1.into(), &0.0.into()));
    assert!(rows.iter().any(|row| row["fidelity"] == advice["recommended"]));

    let folder = machine.path("maps").display().to_string();
    let options = ["--json", "--resolution", "11", "--plane", "x-y", "--output", &folder];
    let map = json(&hexad(&machine, "workspace", &options));
    assert_eq!((&map["slices"][0]["poses"], &map["hint"]), (&121.into(), &Value::Null));
    assert!(map["regions"][0]["guaranteed"].as_f64() > Some(0.1), "{map}");
    // More than the drives can give: no payload, and the limit that takes most of the force.
    let more = ["--angular-acceleration-rad-s2", "5000"];
    let options: Vec<&str> = options.into_iter().chain(more).collect();
    let hint = json(&hexad(&machine, "workspace", &options))["hint"].clone();
    let hint = hint.as_str().expect("a hint");
    assert!(hint.starts_with("payload 0: ") && hint.contains("lower limits.acceleration_rad_s2"), "{hint}");
}

#[test]
fn the_log_is_filtered_and_json_where_it_is_wanted() {
    let machine = Machine::with("logged", "[realtime]\nrate_hz = 100\n");
    assert!(Config::load(&machine.file).is_ok());
    let with = |variables: &[(&str, &str)], more: &[&str]| {
        let mut command = crate::support::children::hexad();
        command.arg("plant").arg("--config").arg(&machine.file).args(more);
        command.envs(variables.iter().copied());
        let plant = Hexad::spawn(&machine, "plant", command);
        let recorder = Recorder::start(&machine.name);
        recorder.until("it measures", |recording| recording.measured.last().map(drop));
        plant.stops_on("TERM", HANG).stderr
    };
    let json = with(&[], &["--log-format", "json"]);
    let lines: Vec<Value> = json.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    let has = |key: &str| lines.iter().all(|line| line[key].is_string());
    assert!(!lines.is_empty() && has("timestamp") && has("level") && has("message"), "{json}");
    assert_eq!(with(&[("HEXAD_LOG", "error")], &[]), "");
    assert_eq!(with(&[("RUST_LOG", "hexad=error,warn")], &[]), "");
    assert_ne!(
        with(&[("RUST_LOG", "off"), ("HEXAD_LOG", "info")], &[]),
        "",
        "HEXAD_LOG counts before RUST_LOG"
    );
    let wrong = with(&[("HEXAD_LOG", "hexad=loud")], &[]);
    assert!(wrong.contains("HEXAD_LOG = \"hexad=loud\" is ignored"), "{wrong}");
}
