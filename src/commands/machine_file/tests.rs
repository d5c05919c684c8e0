use std::fs;

use proptest::prelude::*;
use toml::{Table, Value};

use super::*;
use hexad_machine::config::Config;

const REFERENCE: &str = include_str!("../../../config/reference.toml");
const TILTED: &str = include_str!("../../../tests/data/tilted.toml");

fn one(key: &str, value: f64, deviation: f64) -> NewValue {
    NewValue { key: key.into(), value: NewNumbers::One(Estimate { value, deviation }) }
}

fn array(key: &str, values: &[f64], deviation: f64) -> NewValue {
    let estimates = values.iter().map(|value| Estimate { value: *value, deviation }).collect();
    NewValue { key: key.into(), value: NewNumbers::Array(estimates) }
}

/// Lines of the edited text that the text does not have.
fn new_lines(text: &str, values: &[NewValue]) -> Vec<String> {
    let edited = edited(text, values).unwrap();
    edited.lines().filter(|line| text.lines().all(|old| old != *line)).map(str::to_string).collect()
}

/// All machine files, with their names.
fn machine_files() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["config", "tests/data"].map(|folder| fs::read_dir(root.join(folder)).unwrap());
    let paths = folders.into_iter().flatten().map(|entry| entry.unwrap().path());
    let files: Vec<_> = paths
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .map(|path| (path.display().to_string(), fs::read_to_string(&path).unwrap()))
        .collect();
    assert!(files.len() > 15);
    files
}

/// Numbers and arrays of numbers of a table, without those in arrays of tables, as new values.
fn numbers(table: &Table, above: &str, deviation: impl Fn(f64) -> f64 + Copy) -> Vec<NewValue> {
    let estimate = |value: &Value| {
        let value = value.as_float().or(value.as_integer().map(|x| x as f64))?;
        Some(Estimate { value, deviation: deviation(value) })
    };
    let of_key = |(key, value): (&String, &Value)| {
        let key = format!("{above}{key}");
        let value = match value {
            Value::Table(table) => return numbers(table, &format!("{key}."), deviation),
            Value::Array(items) => items.iter().map(estimate).collect::<Option<_>>().map(NewNumbers::Array),
            _ => estimate(value).map(NewNumbers::One),
        };
        value.map(|value| NewValue { key, value }).into_iter().collect()
    };
    table.iter().flat_map(of_key).collect()
}

#[test]
fn values_that_are_there_change_nothing() {
    for (name, text) in machine_files() {
        for text in [text.replace('\n', "\r\n"), text.trim_end().into(), text] {
            for share in [0.0, 1e-12, 0.3] {
                let values = numbers(&text.parse().unwrap(), "", |value| share * value.abs());
                assert!(values.len() > 15, "{name}");
                assert_eq!(edited(&text, &values).unwrap(), text, "{name}");
            }
        }
    }
}

/// Shifts each number of each file in turn, with line ends of both kinds and without the last one.
#[test]
fn a_new_value_is_read_within_a_tenth_of_its_deviation_and_every_other_value_to_the_bit() {
    for (name, text) in machine_files() {
        for text in [text.replace('\n', "\r\n"), text.trim_end().into(), text] {
            let old: Table = text.parse().unwrap();
            let mut values = numbers(&old, "", |value| 0.0123 * value.abs() + 1e-7);
            for i in 0..values.len() {
                let NewValue { key, value } = values[i].clone();
                let shift = |x: Estimate| Estimate { value: x.value + 2.3456 * x.deviation, ..x };
                let shifted = match value {
                    NewNumbers::One(estimate) => NewNumbers::One(shift(estimate)),
                    NewNumbers::Array(all) => NewNumbers::Array(all.into_iter().map(shift).collect()),
                };
                values[i].value = shifted.clone();
                let edited = edited(&text, &values[i..=i]).unwrap();
                let read = numbers(&edited.parse().unwrap(), "", |value| 0.0123 * value.abs() + 1e-7);
                for (read, expected) in read.iter().zip(numbers(&old, "", |x| 0.0123 * x.abs() + 1e-7)) {
                    if read.key != key {
                        assert_eq!(*read, expected, "{name}");
                        continue;
                    }
                    for (read, new) in read.value.estimates().iter().zip(shifted.estimates()) {
                        let error = (read.value - new.value).abs();
                        assert!(error <= 0.1 * new.deviation, "{name} {key} {error:e} {new:?}");
                    }
                }
                assert_eq!(edited.lines().count(), text.lines().count());
                assert_eq!(edited.matches("\r\n").count(), text.matches("\r\n").count());
                assert_eq!(edited.ends_with('\n'), text.ends_with('\n'));
            }
        }
    }
}

#[test]
fn a_configuration_has_the_new_values() {
    let friction = [70.1, 72.2, 69.3, 80.4, 75.5, 66.6];
    let values = [
        one("platform.mass_kg", 64.2345, 0.21),
        array("platform.center_of_mass_m", &[0.0211111, 0.015, 0.1234], 0.0012),
        one("platform.inertia_kg_m2.xy", -0.12345, 0.01),
        array("actuator.coulomb_friction_n", &friction, 1.7),
    ];
    let config = Config::parse(&edited(TILTED, &values).unwrap(), "new").unwrap();
    let platform = &config.machine.platform;
    assert_eq!((platform.mass_kg, platform.inertia[(0, 1)]), (64.2345, -0.12345));
    assert_eq!(platform.center_of_mass_m.as_slice(), [0.0211111, 0.015, 0.1234]);
    assert_eq!(config.machine.actuator.coulomb_friction_n, friction);
}

#[test]
fn the_old_value_and_the_deviation_are_the_comment() {
    for (line, new, expected) in [
        ("  mass_kg = 15", 15.234, "  mass_kg = 15.234 # was 15, +- 0.12"),
        ("mass_kg=1_5.0# scales", 15.234, "mass_kg=15.234# scales # was 1_5.0, +- 0.12"),
        ("mass_kg = 15.0   # was 14.0, +- 0.2", 15.234, "mass_kg = 15.234 # was 15.0, +- 0.12"),
        ("mass_kg = 15.0 # scales # new, +- 0.2", 15.234, "mass_kg = 15.234 # scales # was 15.0, +- 0.12"),
        ("mass_kg = 15.0 # was 14 in 25", 15.2, "mass_kg = 15.2 # was 14 in 25 # was 15.0, +- 0.12"),
        ("mass_kg = 15.0 # was 14.0, +- 0.2", 15.0000001, "mass_kg = 15.0 # was 14.0, +- 0.2"),
    ] {
        let text = format!("# Payload included.\n[platform]\n# Weighed.\n{line}\n\n# Legs.\n[[leg]]\n");
        let value = one("platform.mass_kg", new, 0.1234);
        let whole = format!("# Payload included.\n[platform]\n# Weighed.\n{expected}\n\n# Legs.\n[[leg]]\n");
        assert_eq!(edited(&text, &[value]).unwrap(), whole);
    }
    let exact = [one("platform.mass_kg", 15.2345678, 0.0)];
    assert_eq!(new_lines(REFERENCE, &exact), ["mass_kg = 15.2346 # was 15.0"]);
}

#[test]
fn a_second_identification_replaces_the_comment_of_the_first() {
    let values = |shift: f64| {
        [
            one("platform.mass_kg", 60.0 + shift, 0.5),
            one("platform.inertia_kg_m2.xx", 4.5 + shift, 0.5),
            one("platform.inertia_kg_m2.zz", 7.5, 0.5),
            one("actuator.coulomb_friction_n", 9.0 + shift, 0.5),
        ]
    };
    let first = edited(TILTED, &values(0.0)).unwrap();
    let tensor = |xx, was: &str| {
        format!(
            "inertia_kg_m2 = {{ xx = {xx}, yy = 3.9, zz = 7.5, xy = -0.11, xz = 0.2, yz = 0.07 }} # {was}"
        )
    };
    let lines = [
        "mass_kg = 60.0 # was 65.0, +- 0.5",
        &tensor(4.5, "xx was 4.2, +- 0.5; zz was 6.5, +- 0.5"),
        "coulomb_friction_n = 9.0 # new, +- 0.5",
    ];
    assert_eq!(new_lines(TILTED, &values(0.0)), lines);
    let lines = [
        "mass_kg = 61.0 # was 60.0, +- 0.5",
        &tensor(5.5, "zz was 6.5, +- 0.5; xx was 4.5, +- 0.5"),
        "coulomb_friction_n = 10.0 # was 9.0, +- 0.5",
    ];
    assert_eq!(new_lines(&first, &values(1.0)), lines);
}

#[test]
fn arrays_keep_their_layout_and_replace_a_number() {
    let text = "[a]\nx = [\n    1.0, # first\n    2.0,\n] # own\ny = 3.0\nz = [4.0, 4.0]\n";
    let values = [array("a.x", &[1.0, 2.5], 0.1), array("a.y", &[3.0, 3.5], 0.1), one("a.z", 4.0, 0.1)];
    let expected = "[a]\nx = [\n    1.0, # first\n    2.5,\n] # own # was [1.0, 2.0], +- [0.1, 0.1]\n\
                    y = [3.0, 3.5] # was 3.0, +- [0.1, 0.1]\nz = [4.0, 4.0]\n";
    assert_eq!(edited(text, &values).unwrap(), expected);
    assert_eq!(edited("a = 3", &[array("a", &[3.0; 6], 0.1)]).unwrap(), "a = 3");
}

#[test]
fn one_of_several_sections_is_named_by_its_number() {
    let text = "[[leg]]\nx = [1.0, 2.0]\n\n# second\n[[leg]]\nx = [3.0, 4.0] # own\n";
    let expected = text.replace("[3.0, 4.0] # own", "[3.0, 4.5] # own # was [3.0, 4.0], +- [0.1, 0.1]");
    assert_eq!(edited(text, &[array("leg[2].x", &[3.0, 4.5], 0.1)]).unwrap(), expected);
    for (key, text) in [("leg[3].x", text), ("leg[0].x", text), ("leg[1].x", "leg = [{ x = [1, 2] }]")] {
        let error = edited(text, &[array(key, &[1.0, 2.0], 0.1)]).unwrap_err().to_string();
        assert!(error.starts_with(key) && error.contains("must be an array of tables, [[leg]]"), "{error}");
    }
}

#[test]
fn missing_keys_and_sections_are_added() {
    let [mass, inertia] = [one("a.mass", 2.0, 0.1), one("a.b.xy", 3.0, 0.0)];
    for (text, expected) in [
        (
            "[a]\n  x = 1 # own\n\n[c]",
            "[a]\n  x = 1 # own\n  mass = 2.0 # new, +- 0.1\n\n[a.b]\nxy = 3.0 # new\n\n[c]",
        ),
        ("[a] # own\n[a.b]\nx = 1\n", "[a] # own\nmass = 2.0 # new, +- 0.1\n[a.b]\nx = 1\nxy = 3.0 # new\n"),
        ("[a]\nb.x = 1\ny = 1", "[a]\nb.x = 1\nb.xy = 3.0 # new\ny = 1\nmass = 2.0 # new, +- 0.1"),
        ("a = { x = 1 }", "a = { x = 1, mass = 2.0, b.xy = 3.0 } # mass new, +- 0.1; b.xy new"),
        ("a = { b = {} }\n", "a = { b = { xy = 3.0 }, mass = 2.0 } # mass new, +- 0.1; b.xy new\n"),
        ("[a.b]\nxx = 1\n", "[a]\nmass = 2.0 # new, +- 0.1\n[a.b]\nxx = 1\nxy = 3.0 # new\n"),
        ("x = 1\n", "x = 1\n\n[a]\nmass = 2.0 # new, +- 0.1\n\n[a.b]\nxy = 3.0 # new\n"),
    ] {
        for line_end in ["\n", "\r\n"] {
            let [text, expected] = [text, expected].map(|text| text.replace('\n', line_end));
            if line_end == "\r\n" && !text.contains('\r') {
                continue;
            }
            assert_eq!(edited(&text, &[mass.clone(), inertia.clone()]).unwrap(), expected);
        }
    }
}

#[test]
fn values_that_cannot_be_written_are_rejected() {
    let refused = |text: &str, key, value| edited(text, &[one(key, value, 0.1)]).unwrap_err().to_string();
    let found = "is of type array of tables in the machine file, must be a table; ";
    assert!(refused(REFERENCE, "leg.base_m", 1.0).starts_with(&format!("leg.base_m {found}")));
    assert!(refused(REFERENCE, "name", 1.0).starts_with("name is of type string in the machine file, "));
    assert!(refused(REFERENCE, "rod.transverse_inertia_kg_m2", 1.0).contains(" is of type table "));
    let not_finite = refused(REFERENCE, "platform.mass_kg", f64::NAN);
    assert!(not_finite.contains("platform.mass_kg must be finite"));
    assert!(refused("a = ", "a", 1.0).starts_with("machine file: "));
}

#[test]
fn files_that_exist_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let [force, link, new] = ["force", "link", "new"].map(|name| folder.path().join(name));
    fs::write(&force, "old").unwrap();
    std::os::unix::fs::symlink(&force, &link).unwrap();
    for path in [&force, &link, &folder.path().join("./force")] {
        let error = write_new(path, "new").unwrap_err().to_string();
        let reason = "exists already; name another file with --output, or remove it";
        assert_eq!(error, format!("{} {reason}", path.display()));
    }
    write_new(&new, "new").unwrap();
    let read = [force, new].map(|path| fs::read_to_string(path).unwrap());
    assert_eq!(read, ["old", "new"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    let missing = write_new(&folder.path().join("none/new"), "new").unwrap_err().to_string();
    assert!(missing.contains("none/new"), "{missing}");
}

#[test]
fn a_difference_shows_changed_and_added_lines() {
    let [old, new] = ["a\n\nb\nc\n\nd", "a\n\nB\nC\nnew\n\nd\n\nend"];
    let expected = "-    3  b\n-    4  c\n+    3  B\n+    4  C\n+    5  new\n+    8  \n+    9  end\n";
    assert_eq!(difference(old, new), expected);
    assert_eq!(difference(new, new), "");
    assert_eq!(difference("a\r\nb", "b"), "-    1  a\n");
    assert_eq!(difference("", "b"), "+    1  b\n");
}

#[test]
fn changed_margins_are_lines_of_the_report() {
    let parse = |text: &str| Config::parse(text, "a test").unwrap();
    let values = [one("platform.mass_kg", 20.0, 0.5), one("actuator.load_friction", 0.1, 0.01)];
    let (old, new) = (parse(REFERENCE), parse(&edited(REFERENCE, &values).unwrap()));
    assert_eq!(changed_margins(&old, &old), [""; 0]);
    let changed = changed_margins(&old, &new);
    let has = |start: &str| changed.iter().any(|pair| pair.starts_with(start));
    assert!(
        [": valid. ", "\n-> reference: NOT VALID, errors: 1. "]
            .iter()
            .all(|words| changed[0].contains(words))
    );
    assert!(changed[1].starts_with("     1  0.") && changed[1].contains("\n->   1  0."), "{changed:#?}");
    assert!(has("   (none)\n-> drives       of ") && has("   (none)\n-> ERROR: "), "{changed:#?}");
    assert!(changed.iter().all(|pair| !pair.contains("condition  ")), "{changed:#?}");
}

proptest! {
    #[test]
    fn a_rounded_number_is_within_a_tenth_of_its_deviation(
        x in -1.0..1.0_f64, exponent in -12..12_i32, deviation in 1.0..10.0_f64, smaller in -6..12_i32,
    ) {
        let value = x * 10_f64.powi(exponent);
        let deviation = deviation * 10_f64.powi(exponent - smaller);
        let edited = edited("a = 1e13", &[one("a", value, deviation)]).unwrap();
        let read = edited.parse::<Table>().unwrap()["a"].as_float().unwrap();
        prop_assert!((read - value).abs() <= 0.1 * deviation, "{edited}");
    }
}
