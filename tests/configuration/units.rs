//! Wrong units: each physical key times the factors by which units differ.

use std::collections::BTreeSet;
use std::fs;

use hexad::config::Config;
use hexad_support::certificate::{Certificate, cases};
use toml::{Table, Value};

/// Kilo and milli, inch and its inverse, kilogram-force, degree.
const FACTORS: [f64; 6] = [1e3, 1e-3, 0.0254, 39.4, 9.81, 57.3];

/// Pairs that cannot be known of every machine: stage and telescope differ by more. `docs/operator.md` names the keys.
const UNKNOWN: [(&str, &[f64]); 29] = [
    ("actuator.coulomb_friction_n", &[0.0254, 9.81]),
    ("actuator.max_force_n", &[0.0254, 39.4, 9.81]),
    ("actuator.max_rate_m_s", &FACTORS),
    ("actuator.reflected_mass_kg", &[0.0254, 39.4, 9.81, 57.3]),
    ("actuator.viscous_friction_n_s_m", &[0.0254, 39.4, 9.81, 57.3]),
    ("control.disturbance_m_s2_per_sqrt_s", &[9.81]),
    ("control.engage_orientation_rad", &[9.81]),
    ("control.engage_position_m", &[9.81]),
    ("control.following_orientation_rad", &[9.81]),
    ("control.following_position_m", &[9.81]),
    ("control.lost_hold_s", &FACTORS),
    ("cylinder.axial_inertia_kg_m2", &[0.0254, 39.4, 9.81, 57.3]),
    ("cylinder.transverse_inertia_kg_m2", &[0.0254, 39.4, 9.81]),
    ("in_position.tolerance_m", &[0.0254, 9.81]),
    ("in_position.tolerance_rad", &[39.4, 9.81]),
    ("limits.acceleration_rad_s2", &[9.81]),
    ("limits.jerk_m_s3", &[9.81]),
    ("limits.jerk_rad_s3", &[9.81]),
    ("limits.payload_change_kg", &[0.0254, 9.81]),
    ("limits.stroke_margin_m", &[39.4, 9.81]),
    ("measured.length_noise_m", &[9.81]),
    ("measured.length_step_m", &[9.81]),
    ("measured.pose_tolerance_m", &[9.81]),
    ("platform.center_of_mass_m", &[1e-3, 0.0254, 9.81]),
    ("platform.inertia_kg_m2", &[9.81]),
    ("platform.mass_kg", &[9.81]),
    ("rod.axial_inertia_kg_m2", &[0.0254, 39.4, 9.81, 57.3]),
    ("rod.mass_kg", &[9.81]),
    ("rod.transverse_inertia_kg_m2", &[0.0254, 9.81]),
];

/// Sections whose keys are physical, `""` for the top and `leg` for all legs at once. Those of the simulated hardware may be any, and
/// those of times and rates of the loop have bounds of their own.
const SECTIONS: [&str; 11] = [
    "",
    "platform",
    "cylinder",
    "rod",
    "actuator",
    "home",
    "leg",
    "limits",
    "measured",
    "control",
    "in_position",
];

fn machines() -> Vec<(String, Table)> {
    let files = ["tests/data", "config"].iter().flat_map(|folder| fs::read_dir(folder).unwrap());
    let mut paths: Vec<_> = files.map(|file| file.unwrap().path().display().to_string()).collect();
    paths.retain(|path| path.ends_with(".toml"));
    paths.sort_by_key(|path| (path != "config/motion_base.toml", path.clone()));
    let read = |path: String| (path.clone(), fs::read_to_string(path).unwrap().parse().unwrap());
    paths.into_iter().map(read).collect()
}

fn scaled(value: &Value, factor: f64) -> Value {
    match value {
        Value::Integer(x) => Value::Float(*x as f64 * factor),
        Value::Float(x) => Value::Float(x * factor),
        Value::Array(items) => items.iter().map(|item| scaled(item, factor)).collect::<Vec<_>>().into(),
        Value::Table(table) => {
            Value::Table(table.iter().map(|(key, value)| (key.clone(), scaled(value, factor))).collect())
        }
        other => other.clone(),
    }
}

/// Physical keys of a section with a value other than zero.
fn keys(table: &Table, section: &str) -> Vec<String> {
    let found = match (section, table.get(section)) {
        ("", _) => vec!["gravity_m_s2".into()],
        ("leg", _) => vec!["base_m".into(), "platform_m".into()],
        (_, Some(Value::Table(of_section))) => {
            let is_zero = |value: &Value| scaled(value, 2.0) == scaled(value, 1.0);
            let stated = of_section.iter().filter(|(_, value)| !is_zero(value));
            stated.map(|(key, _)| key.clone()).collect()
        }
        _ => vec![],
    };
    let has_unit = |key: &String| {
        ["_m", "_kg", "_m2", "_n", "_s", "_s2", "_s3", "_rad", "_deg", "_hz"]
            .iter()
            .any(|unit| key.ends_with(unit))
            || key == "pose"
    };
    found.into_iter().filter(has_unit).collect()
}

fn with_scaled(table: &Table, section: &str, key: &str, factor: f64) -> Table {
    let mut table = table.clone();
    let scale = |table: &mut Table| table[key] = scaled(&table[key], factor);
    match section {
        "" => scale(&mut table),
        "leg" => {
            table["leg"]
                .as_array_mut()
                .unwrap()
                .iter_mut()
                .for_each(|leg| scale(leg.as_table_mut().unwrap()));
        }
        _ => scale(table[section].as_table_mut().unwrap()),
    }
    table
}

/// Errors and warnings of a file that loads.
fn findings(table: &Table) -> Option<Vec<String>> {
    let found = Config::parse(&toml::to_string(table).unwrap(), "m").ok()?.examine();
    Some(found.errors.iter().chain(&found.warnings).map(ToString::to_string).collect())
}

#[test]
fn certificate_a_wrong_unit_is_named_or_known_to_be_unknowable() {
    let of_machines = cases(machines(), usize::MAX);
    let certificate = Certificate::new("units", of_machines.len() as u64, of_machines.len() as u64);
    let (mut missed, mut pairs) = (BTreeSet::new(), BTreeSet::new());
    for (name, table) in &of_machines {
        let usual = findings(table).unwrap();
        let is_false = |text: &&String| text.contains("usual is") || text.contains("on the Earth");
        assert_eq!(usual.iter().find(is_false), None, "{name}");
        for section in SECTIONS {
            for key in keys(table, section) {
                for factor in FACTORS {
                    let name = format!("{section}.{key}");
                    let found = findings(&with_scaled(table, section, &key, factor));
                    pairs.insert((name.clone(), factor.to_string()));
                    if found.is_some_and(|found| found.len() <= usual.len()) {
                        missed.insert((name, factor.to_string()));
                    }
                }
            }
        }
        certificate.advance(1);
    }
    let known =
        UNKNOWN.iter().flat_map(|(key, factors)| factors.iter().map(|it| (key.to_string(), it.to_string())));
    let unknown: BTreeSet<_> = known.collect();
    let unexpected: Vec<_> = missed.difference(&unknown).collect();
    assert!(unexpected.is_empty(), "{unexpected:?}");
    if Certificate::is_long() {
        let stale: Vec<_> = unknown.difference(&missed).collect();
        assert!(
            stale.is_empty() && 4 * unknown.len() <= pairs.len(),
            "{stale:?}, {} of {}",
            unknown.len(),
            pairs.len()
        );
    }
    certificate.finish(format!("{} of {} pairs missed", missed.len(), pairs.len()));
}
