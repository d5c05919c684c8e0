//! Whole files: those that load, and those with many mistakes, broken syntax or random damage.

use std::fs;
use std::path::Path;

use hexad::config::Config;
use hexad::model::inverse_jacobian::condition;
use hexad::model::task::TaskState;
use proptest::prelude::*;

use super::{REFERENCE, fried_with, violations};
use crate::fuzz::properties::config::{PLACE, check_refusal};

#[test]
fn the_machines_load() {
    for folder in ["config", "tests/data"] {
        let files = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)).unwrap();
        let is_toml = |path: &Path| path.extension().is_some_and(|e| e == "toml");
        let files: Vec<_> = files.map(|file| file.unwrap().path()).filter(|path| is_toml(path)).collect();
        assert!(files.len() >= 4, "{folder}");
        for file in files {
            let config = Config::load(&file).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(config.name, file.file_stem().unwrap().to_str().unwrap());
            let pose = TaskState::at_rest(config.machine.home).motion().pose;
            let condition = condition(&config.machine, &pose);
            assert!((1.0..100.0).contains(&condition), "{file:?}: {condition}");
        }
    }
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let error = Config::load(Path::new("config/absent.toml")).unwrap_err();
    assert!(error.to_string().starts_with("config/absent.toml: could not be read: "), "{error}");
}

/// Every kind of mistake in one file. A line that ends in `!` makes one violation.
const BAD: &str = r#"# !
name = "two words" # !
gravty_m_s2 = [-9.81, 0.0, 0.0] # !
[platform]
mass_kg = -3.0 # !
center_of_mass_m = [0.0, nan, 0.0] # !
inertia_kg_m2 = { xx = 1.0, yy = 1.0, zz = 3.0 } # !
[cylinder] # !
mass_kg = 0.5
center_of_mass_m = 0.15
transverse_inertia_kg_m2 = 0.0038
[rod]
mass_kg = "1" # !
center_of_mass_m = 0.15
axial_inertia_kg_m2 = 0.1
transverse_inertia_kg_m2 = 0.04 # !
[actuator]
min_length_m = 0.85
max_length_m = 1.6
max_rate_m_s = true # !
max_force_n = 500.0
[home]
pose = [0.0, 0.0, 0.0, 1.1, 0.0, 0.0]
[[leg]]
base_m = [0.0, 0.738605814759, 0.13023613325]
platform_m = [0.0, 0.321393804843] # !
[[leg]]
base_m = [0.0, -0.256515107494, 0.704769465589]
platform_m = [
    0.0,
    "0.171010071663", # !
    0.469846310393,
]
[[leg]]
base_m = [0.0, -0.482090707265, 0.574533332339]
platform_m = [0.0, -0.492403876506, 0.086824088833]
universal_axis = [0, 0, 0] # !
[[leg]]
base_m = [0.0, -0.482090707265, -0.574533332339]
platform_m = [0.0, -0.492403876506, "0"] # !
[[leg]] # !
base_m = [-3.0, -0.256515107494, -0.704769465589]
platform_m = [0.0, 0.171010071663, -0.469846310393]
[[leg]]
base_m = [0.0, 0.738605814759, -0.13023613325]
platform_m = [0.0, 0.321393804843, -0.383022221559]
colour = "red" # !
[realtime]
rate_hz = 1e3
priority = 0 # !
[control]
orientation_bandwidth_hz = 400 # !
[timeouts]
setpoint_ms = 0.5 # !
"#;

#[test]
fn everything_wrong_is_reported_at_once() {
    let marked = BAD.lines().enumerate().filter(|(_, line)| line.ends_with('!')).map(|(i, _)| i + 1);
    let message = Config::parse(BAD, "bad.toml").unwrap_err().to_string();
    let lines = violations(BAD).iter().map(|violation| violation.line).collect::<Vec<_>>();
    assert_eq!(lines, marked.collect::<Vec<_>>(), "{message}");
    assert_eq!(message.lines().count(), lines.len());
    let first = "bad.toml:1: gravity_m_s2: missing, must be an array of 3 numbers\n";
    assert!(message.starts_with(first), "{message}");
    assert!(message.contains("\nbad.toml:5: platform.mass_kg = -3.0: must be greater than 0\n"), "{message}");
}

#[test]
fn a_syntax_error_hides_nothing_below_it() {
    let bad_force = fried_with("max_force_n = 500.0", "max_force_n = -1");
    let force = "actuator.max_force_n = -1: must be greater than 0";
    let line = |text: &str| 1 + bad_force.lines().take_while(|line| !line.starts_with(text)).count();
    for (from, to, at, message) in [
        ("mass_kg = 3.0", "mass_kg 3.0", "mass_kg", "mass_kg 3.0: key with no value, expected `=`"),
        ("mass_kg = 3.0", "mass_kg =", "mass_kg", "mass_kg =: "),
        ("mass_kg = 3.0", "mass_kg = 3,0", "mass_kg", "mass_kg = 3,0: unexpected key or value"),
        ("mass_kg = 3.0", "mass_kg = heavy", "mass_kg", "mass_kg = heavy: string values must be quoted"),
        ("[platform]", "[platform", "[platform]", "[platform: unclosed table"),
        ("name = \"fried2008\"", "name = \"fried", "name", "name = \"fried: invalid basic string"),
        ("9.81, 0.0, 0.0]", "9.81, 0.0, 0.0\n# and\n", "gravity", "gravity_m_s2 = [-9.81, 0.0, 0.0: "),
        (
            "inertia_kg_m2 = { xx = 0.375, yy",
            "inertia_kg_m2 = { xx = 0.375 yy",
            "inertia",
            "inertia_kg_m2 = { xx = 0.375 yy = 0.1875, zz = 0.1875 }: string values must be quoted",
        ),
        ("mass_kg = 3.0", "mass_kg = 3.0\nmass_kg = 3.0", "center_of_mass_m", "mass_kg = 3.0: duplicate key"),
        ("[cylinder]", "[platform]", "[cylinder]", "[platform]: duplicate key"),
    ] {
        assert_eq!(bad_force.matches(from).count(), 1, "{from}");
        let found = violations(&bad_force.replace(from, to));
        let [syntax, other] = found.as_slice() else { panic!("after {to:?}: {found:#?}") };
        assert_eq!((syntax.line, syntax.key.as_str()), (line(at), "TOML syntax"), "after {to:?}");
        assert!(syntax.to_string().starts_with(&format!("TOML syntax = {message}")), "{syntax}");
        assert_eq!(other.to_string(), force, "after {to:?}");
    }
}

#[test]
fn what_is_no_configuration_at_all_is_refused_in_few_words() {
    let prose = "Once upon a time\n".repeat(1000);
    assert_eq!(violations(&prose).len(), 20);
    let of_nothing = violations("");
    assert!(of_nothing.iter().all(|found| found.line == 1 && found.bound.starts_with("missing")));
    assert!(!of_nothing.is_empty());
}

#[test]
fn many_mistakes_are_counted() {
    let keys = |count: usize| (0..count).map(|i| format!("key{i:03} = 0\n")).collect::<String>();
    let found = violations(&format!("{}{REFERENCE}", keys(1000)));
    assert_eq!((found.len(), found[99].key.as_str(), found[100].line), (101, "key099", 100));
    assert_eq!(found[100].to_string(), "and 900 more: not shown, as 100 are");
    assert_eq!(violations(&format!("{}{REFERENCE}", keys(100))).len(), 100);
    // A file full of legs: those beyond what can be shown are not even read.
    let legs = violations(&"[[leg]]\n".repeat(8000));
    assert_eq!(legs.len(), 101);
    assert!(legs.iter().any(|found| found.to_string().starts_with("leg = 8000 sections: must be 6 ")));
}

#[test]
fn what_a_file_says_is_shown_on_one_line_and_cut() {
    let key = format!("\"a\\nb\\u001b[2J{}\"", "c".repeat(1000));
    let found = violations(&format!("{key} = \"\"\"1\n2\"\"\"\n{REFERENCE}"));
    let shown = format!("a b\\u{{1b}}[2J{}... = \"\"\"1 2\"\"\": unknown key, ", "c".repeat(48));
    assert!(found.len() == 1 && found[0].to_string().starts_with(&shown), "{found:?}");
    let found = violations(&format!("\u{1b}[2J{}\n{REFERENCE}", "c".repeat(1000)));
    let shown = format!("TOML syntax = \\u{{1b}}[2J{}...: ", "c".repeat(51));
    assert!(found.len() == 1 && found[0].to_string().starts_with(&shown), "{found:?}");
}

proptest! {
    /// No text makes the reader panic or hang, and each mistake is refused as the fuzzer wants it.
    #[test]
    fn damaged_files_are_read_to_the_end(
        damage in prop::collection::vec((0..REFERENCE.len(), 0..40usize, r#"(\PC|[\[\]{}="'.,#\n0-9-]){0,4}"#), 1..4),
    ) {
        let mut text: Vec<char> = REFERENCE.chars().collect();
        for (at, length, insert) in damage {
            let at = at.min(text.len());
            let end = (at + length).min(text.len());
            text.splice(at..end, insert.chars());
        }
        let text: String = text.into_iter().collect();
        if let Err(error) = Config::parse(&text, PLACE) {
            check_refusal(&error, text.as_bytes());
        }
    }
}
