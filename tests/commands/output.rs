//! What commands print, as text and as JSON, and what they write, where no daemon runs.

use std::fs::{self, File};
use std::process::{Command, Stdio};

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::Request;
use hexad_support::data;
use serde_json::Value;

use super::{Folder, has, name};

const FRAMES: &str = include_str!("frames.toml");
const ENVELOPE: &str = "
[envelope]
pose_min = [-0.2, -0.2, -0.2, -0.1, -0.1, -0.1]
pose_max = [0.2, 0.2, 0.2, 0.1, 0.1, 0.1]
velocity = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1]
acceleration = [0.3, 0.3, 0.3, 0.3, 0.3, 0.3]
";

/// The machine of the paper with drives that are too weak to hold it.
fn weak() -> Folder {
    let folder = Folder::new("");
    folder.write(
        "machine.toml",
        folder.read("machine.toml").replace("max_force_n = 500.0", "max_force_n = 15.7"),
    );
    folder
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn a_check_shows_the_machine_and_draws_it() {
    let folder = Folder::new("");
    let text = folder.says("check @M --drawing @/machine.svg");
    has(
        &text,
        &[
            &format!("{}: valid", name()),
            "length",
            "force",
            "6 is best",
            "gain margin",
            "\nin position  within ",
        ],
    );
    assert_eq!(text.matches(" deg\n").count(), 6, "a line for each leg:\n{text}");
    assert!(!text.contains("WARNING"), "no other pose is near, and no loop is bold:\n{text}");
    let words = ["from above", "from the side", "in perspective", "x [m]", "y [m]", "z [m]"];
    has(&folder.read("machine.svg"), &words);
    let (code, _, errors) = folder.run("check @M --drawing @/missing/machine.svg");
    assert!(code == Some(1) && errors.contains("missing/machine.svg"), "{errors}");
    has(&weak().run("check @M").1, &["NOT VALID, errors: 1", "101.8 %"]);

    let sound = json(&folder.says("check @M --json"));
    assert_eq!((&sound["is_valid"], &sound["errors"]), (&true.into(), &Value::Array(vec![])));
    let condition = sound["condition"].as_f64().unwrap();
    assert!((6.0..20.0).contains(&condition), "{condition}: 6 is best");
    assert_eq!(sound["loops"][0]["name"], "position");
    assert_eq!(sound["tolerances"]["settling_s"], 0.1);
    let (code, text, _) = weak().run("check @M --json");
    let found = json(&text);
    assert_eq!((code, &found["schema"], &found["machine"]), (Some(2), &1.into(), &name().into()));
    assert_eq!((&found["is_valid"], found["legs"].as_array().map(Vec::len)), (&false.into(), Some(6)));
    let error = &found["errors"][0];
    assert_eq!((&error["key"], &error["line"]), (&"actuator.max_force_n".into(), &28.into()));
}

/// As an argument a machine file is the same as as an option.
#[test]
fn a_machine_file_is_an_argument_too() {
    let folder = Folder::new("");
    for command in ["check", "status", "estop"] {
        let [by_argument, by_option] =
            ["@/machine.toml", "@M"].map(|file| folder.run(&format!("{command} {file}")));
        assert_eq!(by_argument, by_option);
    }
}

#[test]
fn without_a_daemon_a_request_says_so() {
    let folder = Folder::new("");
    for request in Request::ALL {
        let (code, output, errors) = folder.run(&format!("{} @M", request.name()));
        assert_eq!((code, &*output), (Some(2), ""), "{}: {errors}", request.name());
        has(&errors, &[&format!("no daemon runs for {}: ", name())]);
    }
}

#[test]
fn advise_and_workspace_print_json() {
    let folder = Folder::new("");
    let advice = json(&folder.says("advise @M --json"));
    let rows = advice["fidelities"].as_array().unwrap();
    let exact = rows.iter().find(|row| row["fidelity"] == "exact").unwrap();
    assert_eq!((&advice["schema"], &exact["max_n"]), (&1.into(), &0.0.into()));
    assert!(rows.iter().any(|row| row["fidelity"] == advice["recommended"]));

    let line = "workspace @M --json --resolution 11 --plane x-y --output @/maps";
    let map = json(&folder.says(line));
    assert_eq!((&map["slices"][0]["poses"], &map["hint"]), (&121.into(), &Value::Null));
    assert!(map["regions"][0]["guaranteed"].as_f64() > Some(0.1), "{map}");
    // More than the drives can give: no payload, and the limit that takes most of the force.
    let map = json(&folder.says(&format!("{line} --angular-acceleration-rad-s2 5000")));
    let hint = map["hint"].as_str().unwrap();
    assert!(hint.starts_with("payload 0: ") && hint.contains("lower limits.acceleration_rad_s2"), "{hint}");
}

/// As of `hexad check | head -1`; and what could not be written is no success.
#[test]
fn a_closed_pipe_is_no_failure_and_a_full_disk_is_one() {
    let hexad = || Command::new(env!("CARGO_BIN_EXE_hexad"));
    let mut child = hexad().arg("faults").stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
    let full = File::options().write(true).open("/dev/full").unwrap();
    let ended = hexad().arg("faults").stdout(full).output().unwrap();
    assert_eq!(ended.status.code(), Some(1));
    has(&String::from_utf8_lossy(&ended.stderr), &["standard output: No space left"]);
}

#[test]
fn a_diagnostic_is_explained_by_its_number() {
    let folder = Folder::new("");
    let words = folder.says("faults 125").split_whitespace().collect::<Vec<_>>().join(" ");
    let expected = "125 sensor frozen The readings of a leg stayed the same to the last bit while its reference moved. \
                    Forces are disabled and the brakes close at once; fault until cleared. To do: check the encoder of this leg and \
                    the driver";
    assert_eq!(words, expected);
    let [all, one] = ["faults --json", "faults 125 --json"]
        .map(|line| serde_json::from_str::<Vec<Value>>(&folder.says(line)).unwrap());
    assert_eq!(all.len() + 1, DiagnosticCode::ALL.len());
    for entry in &all {
        for text in ["name", "cause", "reaction", "remedy"] {
            assert!(entry[text].as_str().is_some_and(|text| !text.trim().is_empty()), "{text}: {entry}");
        }
    }
    assert!(one.len() == 1 && all.contains(&one[0]) && one[0]["reaction"] == "brake", "{one:?}");
}

/// As after `cargo install`, which installs nothing but the program.
#[test]
fn manual_pages_and_completions_are_written_by_the_program() {
    let folder = Folder::new("");
    folder.says("manuals @/manuals");
    let help = folder.says("--help");
    let commands =
        help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let named = commands.filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    let commands: Vec<_> = named.filter(|name| !name.is_empty() && *name != "help").collect();
    assert!(commands.len() > 30 && !commands.contains(&"manuals"), "{commands:?}");
    for command in commands {
        has(&folder.read(&format!("manuals/man/hexad-{command}.1")), &[".SH NAME"]);
    }
    for shell in ["hexad.bash", "_hexad", "hexad.fish"] {
        has(&folder.read(&format!("manuals/completions/{shell}")), &["inverse-dynamics"]);
    }
}

/// Number of seconds that a plan shows.
fn duration_s(plan: &str) -> f64 {
    let duration = plan.lines().find_map(|line| line.strip_prefix("duration  ")).unwrap();
    duration.split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn a_dry_run_needs_no_daemon() {
    let folder = Folder::new(FRAMES);
    let plan = folder.says("goto @M --relative --x 50mm --y=-5mm --z -3um --gamma 100mrad --dry-run");
    let words = [
        "from is home, as no daemon answers",
        "1150.000",
        "-5.000",
        "-0.003",
        "5.7296",
        "limited by velocity",
    ];
    has(&plan, &words);
    // 50 mm at a fifth of 1 m/s, 5 m/s^2 and 100 m/s^3: at least d / v + v / a + a / j = 0.46 s.
    assert!(duration_s(&plan) > 0.45 && duration_s(&plan) < 1.2 * 0.46 + 0.1, "{plan}");
    // With 0.2 m/s half of the speed doubles d / v.
    let [whole, half] = ["100%", "0.5"].map(|speed| {
        duration_s(&folder.says(&format!("goto @M --relative --x 100mm --dry-run --speed {speed}")))
    });
    assert!((half - whole - 0.5).abs() < 0.02, "{whole} s and {half} s");
}

/// Steps of a machine with a stroke of 0.1 mm, and of one with 28 mm, have digits on the screen.
#[test]
fn a_small_step_is_seen() {
    let folder = Folder::new("");
    for (name, alpha, z) in [("piezo", "0.000833", "135.005000"), ("telescope_m2", "0.00083", "-702.9950")] {
        folder.write("machine.toml", fs::read(data(name, "toml")).unwrap());
        let shown = folder.says("goto @M --relative --z 5um --alpha 3arcsec --dry-run");
        let to: Vec<_> =
            shown.lines().find(|line| line.starts_with("to ")).unwrap().split_whitespace().collect();
        assert_eq!([to[1], to[6]], [alpha, z], "{name}: {shown}");
    }
    // In the units of a person.
    folder.write("machine.toml", fs::read(data("piezo", "toml")).unwrap());
    let shown = folder.says("goto @M --relative --z 5nm --alpha 0.3arcsec --dry-run --units nm,arcsec");
    let words = shown.split_whitespace().collect::<Vec<_>>().join(" ");
    has(&words, &["alpha arcsec beta arcsec", "y nm z nm", "to 0.300 0.000 0.000 0 0 135000005 from is"]);
}

#[test]
fn coordinates_of_a_tool_are_planned_and_refused() {
    let folder = Folder::new(&[FRAMES, ENVELOPE].concat());
    has(&folder.says("frame list @M"), &["tip", "300.000", "work"]);
    has(&folder.says("frame list @M --units um,mrad"), &["alpha mrad", "x um", " 300000 "]);
    // Home is x = 1.1 m, the tip 0.3 m beyond it: at the table's origin.
    let plan = folder.says("goto @M --tool tip --work table --gamma 4deg --dry-run");
    has(&plan, &["coordinates of tip in table", "4.000", "the tool goes straight", "from is home"]);
    let words =
        ["x = 1.25", "bound 1.20", "coordinates of the platform in the base frame", "1250.000", "  150.000"];
    folder.refuses("goto @M --tool tip --work table --x 150mm --dry-run", &words);
}
