//! Configurations that load but must not be run: drives, limits, legs, gravity, envelope, timeouts.

use std::fs;

use hexad::config::deployment::default_limits::derived_limits;
use hexad::config::examination::Examination;
use hexad::config::{Config, Violation};
use hexad::model::random::Random;

use super::{FRIED, REFERENCE, SIX_THREE};

const MOTION_BASE: &str = include_str!("../../config/motion_base.toml");
const TSAI: &str = include_str!("../../config/tsai2000.toml");

/// The text of a machine of `tests/data`.
fn data(name: &str) -> String {
    fs::read_to_string(hexad_support::data(name, "toml")).unwrap()
}

/// Machines of the test vectors.
fn others() -> impl Iterator<Item = String> {
    ["ceiling", "gimbal", "scattered", "sideways_x_up", "tabletop", "telescope", "tilted"]
        .into_iter()
        .map(data)
}

/// Machines as they are built: from a piezo stage to the mount of a telescope.
fn built() -> impl Iterator<Item = String> {
    ["six_three", "hanging_chair", "hobby", "piezo", "plate_3m", "telescope_m2"].into_iter().map(data)
}

fn load(text: &str) -> Config {
    Config::parse(text, "test.toml").unwrap()
}

fn examine(text: &str) -> Examination {
    load(text).examine()
}

/// The motion base with one piece of text replaced.
fn base_with(from: &str, to: &str) -> String {
    assert_eq!(MOTION_BASE.matches(from).count(), 1, "{from:?} must be in the file once");
    MOTION_BASE.replace(from, to)
}

fn text(found: &[Violation]) -> Vec<String> {
    found.iter().map(ToString::to_string).collect()
}

/// Asserts that there is one error, with these words, in the line of this text.
fn refused(file: &str, line: &str, words: &[&str]) {
    let found = examine(file);
    let [error] = found.errors.as_slice() else { panic!("{:#?}", text(&found.errors)) };
    for word in words {
        assert!(error.to_string().contains(word), "{word:?} must be in {error}");
    }
    let number = 1 + file.lines().position(|written| written.starts_with(line)).unwrap();
    assert_eq!(error.line, number, "{error}");
}

#[test]
fn machines_in_order_are_valid_and_only_hanging_ones_are_warned_of() {
    let own = [FRIED, REFERENCE, MOTION_BASE, TSAI].map(String::from).into_iter();
    for file in own.chain(others()).chain(built()) {
        let (config, found) = (load(&file), examine(&file));
        assert_eq!(text(&found.errors), [""; 0], "{}", config.name);
        let keys: Vec<_> = found.warnings.iter().map(|warning| warning.key.as_str()).collect();
        let hangs = ["ceiling", "hanging_chair", "telescope_m2"].contains(&config.name.as_str());
        let expected: &[&str] = if hangs { &["gravity_m_s2"] } else { &[] };
        assert_eq!(keys, expected, "{}: {:#?}", config.name, text(&found.warnings));
    }
}

#[test]
fn drives_that_cannot_hold_the_platform_with_a_margin_are_refused() {
    // Leg 6 holds 3807 N at home; at most 90 % may be needed.
    let needed = "must be at least 4230 to hold the platform: leg 6 needs 3806.91 N at home";
    for force in [4229.0, 3000.0, 40.0] {
        let file = base_with("max_force_n = 20000.0", &format!("max_force_n = {force:.1}"));
        refused(&file, "max_force_n", &[&format!("actuator.max_force_n = {force}: "), needed]);
    }
    let enough = examine(&base_with("max_force_n = 20000.0", "max_force_n = 4230.0"));
    assert_eq!(text(&enough.errors), [""; 0]);
}

/// Ranges of an envelope.
fn envelope(angle: f64, position: f64, acceleration: f64) -> String {
    let six = |a: f64, p: f64| format!("[{a}, {a}, {a}, {p}, {p}, {p}]");
    format!(
        "\n[envelope]\npose_min = {}\npose_max = {}\nvelocity = {}\nacceleration = {}\n",
        six(-angle, -position),
        six(angle, position),
        six(0.1, 0.1),
        six(acceleration, acceleration)
    )
}

#[test]
fn an_envelope_must_be_within_stroke_regular_and_held() {
    let with = |angle, position| format!("{MOTION_BASE}{}", envelope(angle, position, 0.5));
    assert_eq!(text(&examine(&with(0.05, 0.05)).errors), [""; 0]);
    assert_eq!(text(&examine(&with(0.05, 0.05)).warnings), [""; 0]);
    refused(&with(0.1, 0.4), "[envelope]", &["from home", "longer there than actuator.max_length_m"]);
    // Where the platform leans, one leg carries more than at home.
    let weak = base_with("max_force_n = 20000.0", "max_force_n = 4240.0") + &envelope(0.15, 0.01, 0.1);
    let words = ["actuator.max_force_n = 4240: must be at least", "within [envelope] at "];
    refused(&weak, "max_force_n", &words);
    // Accelerations are a matter of the task, not of holding: a warning.
    let fast = examine(&format!("{MOTION_BASE}{}", envelope(0.05, 0.05, 20.0)));
    assert_eq!(text(&fast.errors), [""; 0]);
    assert!(fast.warnings.iter().any(|warning| warning.key == "envelope.acceleration"), "{fast:?}");
    // Beyond the singular poses of a machine with much stroke.
    let wide = format!("{TSAI}{}", envelope(1.2, 0.01, 0.1));
    refused(&wide, "[envelope]", &["shrink the ranges"]);
}

#[test]
fn limits_that_the_drives_cannot_give_are_refused_with_those_that_they_can() {
    let with = |line: &str| format!("{MOTION_BASE}\n[limits]\n{line}\n");
    let words = ["= 16: must be at most 14.9", "the drives can give"];
    refused(&with("acceleration_m_s2 = 16.0"), "acceleration_m_s2", &words);
    refused(&with("acceleration_rad_s2 = 25.0"), "acceleration_rad_s2", &["= 25: must be at most 21.8"]);
    // Each alone, but not both at once; and velocities, which the reference keeps.
    for (line, key, words) in [
        (
            "acceleration_rad_s2 = 20.0",
            "limits.acceleration_rad_s2",
            "= 20: with limits.acceleration_m_s2 = 5 the drives can give 14.5",
        ),
        ("velocity_m_s = 1.3", "limits.velocity_m_s", "= 1.3: the legs allow 1.19999"),
        ("velocity_rad_s = 1.3", "limits.velocity_rad_s", "= 1.3: the legs allow 1.21"),
    ] {
        let found = examine(&with(line));
        assert_eq!(text(&found.errors), [""; 0], "{line}");
        let [warning] = found.warnings.as_slice() else { panic!("{:#?}", text(&found.warnings)) };
        assert!(warning.key == key && warning.to_string().contains(words), "{warning}");
    }
}

#[test]
fn defaults_of_limits_are_what_the_drives_can_give() {
    let derived = |file: &str| {
        let config = load(file);
        let found = derived_limits(&config.machine, &config.deployment.limits.reference);
        found.into_iter().map(|limit| (limit.key, limit.value)).collect::<Vec<_>>()
    };
    assert_eq!(derived(FRIED), []);
    assert_eq!(derived(REFERENCE), []);
    assert_eq!(
        derived(MOTION_BASE),
        [("limits.velocity_rad_s", 1.2), ("limits.acceleration_rad_s2", 9.4), ("limits.jerk_rad_s3", 940.0)]
    );
    // Given by hand they are not derived, and the others are as before.
    let limits = "[limits]\nvelocity_rad_s = 1.0\nacceleration_rad_s2 = 7.0\njerk_rad_s3 = 700\n";
    assert_eq!(derived(&format!("{MOTION_BASE}\n{limits}")), []);
    let telescope = load(&data("telescope")).deployment.limits.reference;
    assert_eq!((telescope.position.velocity, telescope.orientation.velocity), (0.02, 0.029));
    assert_eq!((telescope.position.jerk, telescope.orientation.jerk), (280.0, 490.0));
}

/// A machine whose legs have exchanged their joints on the platform.
fn exchanged(file: &str, legs: [usize; 2]) -> String {
    let mut table: toml::Table = file.parse().unwrap();
    let rows = table["leg"].as_array_mut().unwrap();
    let [first, second] = legs.map(|leg| rows[leg]["platform_m"].clone());
    rows[legs[0]]["platform_m"] = second;
    rows[legs[1]]["platform_m"] = first;
    // The stroke must not refuse them.
    let actuator = table["actuator"].as_table_mut().unwrap();
    actuator.insert("min_length_m".into(), 0.05.into());
    actuator.insert("max_length_m".into(), 5.0.into());
    table.to_string()
}

#[test]
#[ignore = "second tier: takes long"]
fn two_joints_of_neighbours_that_are_swapped_are_named() {
    let (mut missed, mut named) = (vec![], 0);
    for file in [FRIED, REFERENCE, MOTION_BASE, TSAI].map(String::from).into_iter().chain(others()) {
        for first in 0..6 {
            for second in first + 1..6 {
                let text = exchanged(&file, [first, second]);
                let Ok(config) = Config::parse(&text, "test.toml") else { continue };
                let found = config.examine();
                let key = format!("leg[{}].platform_m", second + 1);
                let words = [format!("leg {} ", second + 1), format!("leg {}", first + 1)];
                let names = |found: &Violation| {
                    found.key == key && words.iter().all(|word| found.to_string().contains(word))
                };
                if found.errors.iter().chain(&found.warnings).any(names) {
                    named += 1;
                } else {
                    missed.push((config.name, first + 1, second + 1));
                }
            }
        }
    }
    assert_eq!(missed, [], "beside {named} pairs");
    assert!(named >= 90, "{named}: the others do not load");
}

#[test]
fn values_that_are_wrong_by_a_thousand_are_warned_of() {
    let base = |line: &str| format!("{MOTION_BASE}\n{line}\n");
    let tensor = |share: f64| {
        let mut table: toml::Table = MOTION_BASE.parse().unwrap();
        let platform = table["platform"].as_table_mut().unwrap();
        for (_, moment) in platform["inertia_kg_m2"].as_table_mut().unwrap() {
            *moment = (share * moment.as_float().unwrap()).into();
        }
        table.to_string()
    };
    for (file, key, words) in [
        (tensor(1e-3), "platform.inertia_kg_m2", "usual is 0.25 to 2.5; check the units"),
        (tensor(1e3), "platform.inertia_kg_m2", "usual is 0.25 to 2.5; check the units"),
        (base("[drive]\ndelay_us = 0.0005"), "drive.delay_us", "= 0.0005: plausible is 0, or at least 10"),
        (base("[drive]\nlag_us = 0.5"), "drive.lag_us", "= 0.5: plausible"),
        (base("[plant.drive]\ndead_time_us = 0.5"), "plant.drive.dead_time_us", "plausible"),
        (base("[realtime]\nlate_wakeup_us = 0.2"), "realtime.late_wakeup_us", "at least 1;"),
        (base("[realtime]\ncpu = 999"), "realtime.cpu", "= 999: this host has the processors 0"),
        (base("[realtime]\nio_cpu = 999"), "realtime.io_cpu", "= 999: this host has the processors 0"),
    ] {
        let found = examine(&file);
        let named = found.warnings.iter().find(|warning| warning.key == key);
        let text = named.map(ToString::to_string).unwrap_or_default();
        assert!(text.contains(words), "{key}: {:#?}", found.warnings);
    }
}

/// Of each key a good and a bad value, where a filter reads it.
const WORSE: [(&str, &str, f64, f64); 6] = [
    ("measured", "length_noise_m", 1e-8, 1.0),
    ("measured", "length_step_m", 1e-8, 1.0),
    ("measured", "rate_noise_m_s", 1e-7, 1.0),
    ("drive", "delay_us", 10.0, 5000.0),
    ("drive", "lag_us", 10.0, 5000.0),
    ("control", "disturbance_m_s2_per_sqrt_s", 100.0, 1e-3),
];

/// The noise grows, the delay, or the disturbance becomes smaller: neither the estimator nor the default of a loop becomes faster. Only
/// a longer delay may need a faster estimator, where the slower one is not stable with it.
fn compare_worse_sensors(draws: usize) -> ([usize; WORSE.len()], usize) {
    let files = others().chain(built()).chain([MOTION_BASE, TSAI, FRIED].map(String::from));
    let files: Vec<toml::Table> = files.map(|file| file.parse().unwrap()).collect();
    let mut random = Random::new(61);
    let mut between = |low: f64, high: f64| low * (high / low).powf(random.uniform());
    let (mut compared, mut refused) = ([0; WORSE.len()], 0);
    for _ in 0..draws {
        let mut table = files[between(1.0, files.len() as f64 + 1.0) as usize - 1].clone();
        let set = |table: &mut toml::Table, (section, key): (&str, &str), value: f64| {
            let section = table.entry(section).or_insert_with(|| toml::Table::new().into());
            section.as_table_mut().unwrap().insert(key.into(), value.into());
        };
        set(&mut table, ("realtime", "rate_hz"), between(500.0, 4000.0).round());
        let loops =
            ["position_bandwidth_hz", "orientation_bandwidth_hz"].map(|key| ("control", key, 0.5, 40.0));
        for (section, key, low, high) in loops.into_iter().chain(WORSE) {
            if between(1.0, 3.0) < 1.4 {
                set(&mut table, (section, key), between(low, high));
            }
        }
        let chosen = between(1.0, WORSE.len() as f64 + 1.0) as usize - 1;
        let (section, key, good, bad) = WORSE[chosen];
        let first = between(good, bad);
        let second = first * (bad / first).powf(between(0.01, 1.0));
        let [better, worse] = [first, second].map(|value| {
            set(&mut table, (section, key), value);
            Config::parse(&table.to_string(), "a test").ok()
        });
        let (Some(better), Some(worse)) = (better, worse) else { continue };
        compared[chosen] += 1;
        let is_faster = |of: fn(&Config) -> f64| of(&worse) > of(&better) * (1.0 + 1e-9);
        let is_loop_faster = is_faster(|it| it.deployment.control.position_bandwidth_hz)
            || is_faster(|it| it.deployment.control.orientation_bandwidth_hz);
        assert!(!is_loop_faster, "{section}.{key} {first} {second}: {table}");
        if section != "drive" && is_faster(|it| it.deployment.control.estimator_bandwidth_hz) {
            let errors = worse.examine().errors;
            let is_refused = errors.iter().any(|error| error.key == "measured.length_noise_m");
            assert!(is_refused, "{section}.{key} {first} {second}: {table}");
            refused += 1;
        }
    }
    println!("{compared:?}, refused {refused}");
    (compared, refused)
}

#[test]
fn a_worse_sensor_never_makes_a_filter_faster() {
    let (compared, _) = compare_worse_sensors(40);
    assert!(compared.iter().sum::<usize>() > 20);
}

#[test]
#[ignore = "second tier: takes long"]
fn nor_does_one_of_three_hundred_worse_sensors() {
    let (compared, refused) = compare_worse_sensors(300);
    assert!(compared.iter().all(|count| *count > 15) && refused > 0);
}

/// What releases, schedules or simulates the loop is no property of the machine: no file becomes invalid by it, and none has other limits.
#[test]
fn keys_of_running_change_neither_validity_nor_limits() {
    let keys: [(&str, &str, toml::Value); 8] = [
        ("realtime", "release", "lockstep".into()),
        ("realtime", "scheduler", "deadline".into()),
        ("realtime", "priority", 50.into()),
        ("realtime", "io_priority", 40.into()),
        ("realtime", "lock_memory", false.into()),
        ("realtime", "late_wakeup_us", 500.0.into()),
        ("plant.sensor", "length_noise_m", 1e-7.into()),
        ("setpoint", "on_violation", "limit".into()),
    ];
    let files = others().chain(built()).chain([FRIED, MOTION_BASE, TSAI].map(String::from));
    for file in files.chain([data("pocket"), data("pocket").replace("1.7918649518056304", "9.0")]) {
        let of = |config: &Config| (text(&config.examine().errors), config.deployment.limits.clone());
        let plain = of(&load(&file));
        for (section, key, value) in &keys {
            let mut table: toml::Table = file.parse().unwrap();
            let mut inner = &mut table;
            for part in section.split('.') {
                let part = inner.entry(part).or_insert_with(|| toml::Table::new().into());
                inner = part.as_table_mut().unwrap();
            }
            inner.insert((*key).into(), value.clone());
            let with = of(&load(&table.to_string()));
            assert_eq!(with, plain, "[{section}] {key} = {value} in {:.40}", file.lines().last().unwrap());
        }
    }
}

#[test]
fn a_leg_that_may_become_as_short_as_nothing_is_refused_because_it_could_not_move() {
    let error =
        Config::parse(&base_with("min_length_m = 1.1", "min_length_m = 1e-6"), "x").unwrap_err().to_string();
    for words in ["actuator.min_length_m = 1e-6", "at least 0.023", "the length at the end stop"] {
        assert!(error.contains(words), "{error}");
    }
}

/// A long stroke admits home in either order of its angles and positions, also where the other order is singular.
#[test]
fn angles_after_positions_are_named_where_the_stroke_admits_both() {
    let exchanged = |file: &str| {
        let mut table: toml::Table = file.parse().unwrap();
        table["actuator"].as_table_mut().unwrap().insert("min_length_m".into(), 0.02.into());
        table["home"]["pose"].as_array_mut().unwrap().rotate_left(3);
        Config::parse(&table.to_string(), "test.toml")
    };
    let warnings = exchanged(&data("tilted")).unwrap().examine().warnings;
    let words = "alpha, beta, gamma [rad], then x, y, z [m]: at [0.0, 0.0, 0.0, 0.0, 0.0, 0.";
    let named = |found: &str| found.contains(words);
    let mut warnings = text(&warnings).into_iter();
    assert!(warnings.any(|warning| warning.starts_with("home.pose") && named(&warning)));
    let refused = exchanged(&data("hobby")).unwrap_err().to_string();
    assert!(refused.lines().count() == 1 && named(&refused), "{refused}");
}

/// Joints of two legs beside each other are no crossing, however small the distance between them and whatever its direction.
#[test]
fn legs_that_share_a_joint_do_not_cross() {
    for offset in [1e-6, -1e-6, 1e-4, -1e-4, 1e-3, -1e-3] {
        let moved = |x: f64, y: f64| format!("base_m = [{}, {}, 0.0]", x + offset, y - 0.5 * offset);
        let text = SIX_THREE
            .replacen("base_m = [0.58293, 0.33655, 0.0]", &moved(0.58293, 0.33655), 1)
            .replacen("base_m = [0.0, -0.6731, 0.0]", &moved(0.0, -0.6731), 1)
            .replacen("base_m = [-0.58293, 0.33655, 0.0]", &moved(-0.58293, 0.33655), 1);
        assert_eq!(examine(&text), Examination::default(), "{offset}");
    }
}

#[test]
fn gravity_across_the_legs_or_not_of_the_earth_is_warned_of() {
    for (gravity, words) in [
        ("[0.0, 0.0, 9.81]", Some("the platform hangs")),
        ("[9.81, 0.0, 0.0]", Some("is across")),
        ("[3.0, 0.0, -9.34]", None),
        ("[0.0, 0.0, -1.0]", Some("on the Earth")),
        ("[0.0, 0.0, -32.2]", Some("on the Earth")),
        ("[0.0, 0.0, 0.0]", None),
    ] {
        let found =
            examine(&base_with("gravity_m_s2 = [0.0, 0.0, -9.81]", &format!("gravity_m_s2 = {gravity}")));
        let warnings: Vec<_> = found.warnings.iter().filter(|found| found.key == "gravity_m_s2").collect();
        assert_eq!(warnings.len(), usize::from(words.is_some()), "{gravity}: {warnings:?}");
        assert!(warnings.iter().all(|found| found.to_string().contains(words.unwrap())), "{warnings:?}");
    }
}
