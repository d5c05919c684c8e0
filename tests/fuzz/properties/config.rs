//! Any bytes as a configuration file: refused in so many words, or a machine that works at home.

use hexad::commands::check::CheckReport;
use hexad::config::text::read_text;
use hexad::config::{Config, ConfigError, Violation};
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use hexad::model::forward_kinematics::{Tracker, TrackingResult};
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::task::TaskState;

use super::{line_number, lines};

/// What messages call the input.
pub const PLACE: &str = "fuzz.toml";

/// Violations shown at most, and how many there are beyond.
const MAX_VIOLATIONS: usize = 100 + 1;

/// Whether the input is accepted; panics where either answer is wrong.
pub fn hold(input: &[u8]) -> bool {
    let read = read_text(input, PLACE).and_then(|text| Config::parse(&text, PLACE));
    match &read {
        Ok(config) => check_machine(config),
        Err(error) => check_refusal(error, input),
    }
    read.is_ok()
}

/// A line for each violation, in the order of the lines, with place, value and bound.
pub fn check_refusal(error: &ConfigError, input: &[u8]) {
    let ConfigError::Invalid { violations, .. } = error else { panic!("bytes can be read: {error}") };
    assert!((1..=MAX_VIOLATIONS).contains(&violations.len()), "{} violations", violations.len());
    assert!(violations.is_sorted_by_key(|violation| violation.line));
    let message = error.to_string();
    let lines = lines(&message);
    assert_eq!(lines.len(), violations.len(), "a line each: {message}");
    for (line, violation) in lines.iter().zip(violations) {
        let rest = line.strip_prefix(PLACE).and_then(|rest| rest.strip_prefix(':'));
        let (number, what) = rest.and_then(|rest| rest.split_once(": ")).expect(line);
        assert_eq!(line_number(number, input), violation.line);
        assert_eq!(what, violation.to_string());
        check_violation(violation, input);
    }
}

fn check_violation(violation: &Violation, input: &[u8]) {
    let Violation { line, key, value, bound } = violation;
    assert!(!key.is_empty() && !bound.is_empty(), "{violation:?}");
    let of_parser = key == "TOML syntax";
    let summary = key.starts_with("and ") && bound.starts_with("not shown");
    assert!(of_parser || summary || bound.contains("must "), "no bound: {violation:?}");
    // What is not there has no value, and what a header or a dotted key opens is too long to show.
    let written = input.split(|byte| *byte == b'\n').nth(line - 1).unwrap_or_default();
    let opens = written.contains(&b'[') || written.contains(&b'.');
    assert!(value.is_some() || summary || bound.starts_with("missing, ") || opens, "no value: {violation:?}");
}

/// Every number is finite; the model works at home, at rest and in motion.
fn check_machine(config: &Config) {
    let Config { name, machine, deployment, .. } = config;
    assert!((1..=64).contains(&name.len()), "{name}");
    for (what, debug) in [("machine", format!("{machine:?}")), ("deployment", format!("{deployment:?}"))] {
        assert!(!debug.contains("NaN") && !debug.contains("inf"), "{what}: {debug}");
    }
    let actuator = &machine.actuator;
    assert!(0.0 < actuator.min_length_m && actuator.min_length_m < actuator.max_length_m);
    assert!(actuator.max_rate_m_s > 0.0 && actuator.max_force_n > 0.0);
    let masses = [machine.platform.mass_kg, machine.cylinder.mass_kg, machine.rod.mass_kg];
    assert!(masses.iter().all(|mass| *mass > 0.0), "masses {masses:?}");
    for axis in machine.joints.triples.unpack_vectors(&machine.joints.universal_axis) {
        assert!((axis.norm() - 1.0).abs() < 1e-12, "axis of length {}", axis.norm());
    }
    let home = TaskState::at_rest(machine.home);
    let lengths = leg_lengths(machine, &home.motion().pose);
    let stroke = actuator.min_length_m..=actuator.max_length_m;
    assert!(lengths.iter().all(|length| stroke.contains(length)), "{lengths:?} at home, of {stroke:?}");
    let (tracked, _) = Tracker::new(machine, home.motion().pose).find(machine, &lengths);
    assert_eq!(tracked, TrackingResult::Found, "forward kinematics does not find home");
    check_forces(config, &home);
    let examination = config.examine();
    let text = CheckReport::new(config, &examination).to_string();
    let verdict = if examination.errors.is_empty() { "valid." } else { "NOT VALID, " };
    assert!(text.starts_with(&format!("{name}: {verdict}")), "{text}");
    examination.errors.iter().chain(&examination.warnings).for_each(|found| {
        assert!(found.line >= 1 && found.value.is_some() && !found.bound.contains("NaN"), "{found:?}");
    });
    assert!(!text.contains("NaN") && !text.replacen(name, "", 1).contains("inf"), "{text}");
}

/// Every fidelity has forces at home, at rest and when moved as fast as one of the legs may.
fn check_forces(config: &Config, home: &TaskState) {
    let model = InverseDynamics::new(&config.machine);
    let mut moved = *home;
    moved.xd[5] = config.machine.actuator.max_rate_m_s;
    moved.xdd[5] = 1.0;
    for fidelity in Fidelity::ALL {
        for state in [home, &moved] {
            let forces = model.forces_of(fidelity, &state.motion());
            let finite = forces.is_some_and(|forces| forces.iter().all(|force| force.is_finite()));
            assert!(finite, "{} at home: {forces:?}", fidelity.name());
        }
    }
}
