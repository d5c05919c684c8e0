//! Examination of a configuration: whether its machine can be run with it.
//!
//! A file that loads is consistent in itself. Here its parts are compared with each other: drives with the platform's weight at home
//! and in the envelope, limits with drives, timeouts with the margins of the loops, legs with each other. `hexad check` shows the
//! result; the daemon and the demonstration refuse a configuration with an error, with the same sentence.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::control_loops::{ControlLoop, loops, unstable_timeout_ms};
use super::deployment::control::optimum_hz;
use super::syntax::line_at;
use super::{Config, ConfigError, Violation};
use crate::analysis::gravity_cone::{ConeHolding, GravityCone};
use crate::analysis::region_proof::poses;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::rigid::Pose;

mod envelope;
mod machine;
mod usual;
mod values;

/// Result of an examination.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Examination {
    /// Why the machine must not be run.
    pub errors: Vec<Violation>,
    /// What is probably not meant.
    pub warnings: Vec<Violation>,
    /// Forces under gravity in any direction of a cone, if one is examined.
    pub gravity_cone: Option<ConeHolding>,
}

impl Config {
    /// Examines the configuration: some milliseconds, with an envelope up to some seconds.
    pub fn examine(&self) -> Examination {
        self.examine_in_cone(None)
    }

    /// The same with drives that must hold the platform under gravity in any direction within so much of the file's.
    pub fn examine_in_cone(&self, half_angle_rad: Option<f64>) -> Examination {
        let cone_rad = half_angle_rad.unwrap_or(0.0);
        let mut examiner = Examiner { config: self, cone_rad, found: Examination::default() };
        examiner.found.gravity_cone = half_angle_rad.map(|half_angle_rad| {
            let cone = GravityCone::new(self.machine.gravity_m_s2, half_angle_rad);
            let in_envelope = self.deployment.envelope.as_ref();
            let at_rest = |bounds| poses(&self.machine, bounds).map(|state| state.x.into());
            ConeHolding {
                half_angle_rad,
                at_home: cone.worst_holding(&self.machine, [self.machine.home]),
                hardest: in_envelope.and_then(|bounds| cone.worst_holding(&self.machine, at_rest(bounds))),
            }
        });
        usual::examine(&mut examiner);
        values::examine(&mut examiner);
        machine::examine(&mut examiner);
        envelope::examine(&mut examiner);
        examine_loops(&mut examiner);
        examiner.found
    }
}

impl Examination {
    /// The errors as the error of a configuration.
    pub fn into_result(self, config: &Config) -> Result<Vec<Violation>, ConfigError> {
        if self.errors.is_empty() {
            return Ok(self.warnings);
        }
        Err(ConfigError::Invalid { place: config.place.clone(), violations: self.errors })
    }
}

/// Collects what an examination finds.
struct Examiner<'a> {
    config: &'a Config,
    /// Half angle of the directions of gravity.
    cone_rad: f64,
    found: Examination,
}

impl Examiner<'_> {
    fn gravity(&self) -> GravityCone {
        GravityCone::new(self.config.machine.gravity_m_s2, self.cone_rad)
    }

    /// The leg, counted from 0, that needs the largest force to hold the platform under gravity in any direction of the cone.
    fn largest_holding_force(&self, pose: &Pose) -> Option<(usize, f64)> {
        self.gravity().largest_holding_force(&InverseDynamics::new(&self.config.machine), pose)
    }

    fn error(&mut self, key: &str, value: impl Into<String>, bound: impl Into<String>) {
        let violation = self.violation(key, value.into(), bound.into());
        self.found.errors.push(violation);
    }

    fn warn(&mut self, key: &str, value: impl Into<String>, bound: impl Into<String>) {
        let violation = self.violation(key, value.into(), bound.into());
        self.found.warnings.push(violation);
    }

    /// Whether the file has this key.
    fn is_stated(&self, key: &str) -> bool {
        let (table, _) = DeTable::parse_recoverable(&self.config.text);
        let mut parts = key.split('.');
        let first = parts.next().and_then(|name| table.get_ref().get(name));
        parts.try_fold(first, |found, part| Some(found?.get_ref().as_table()?.get(part))).flatten().is_some()
    }

    fn violation(&self, key: &str, value: String, bound: String) -> Violation {
        Violation { line: line_of(&self.config.text, key), key: key.into(), value: Some(value), bound }
    }
}

/// Stability of the control loops, and the timeout of measurements against it.
fn examine_loops(examiner: &mut Examiner) {
    let deployment = &examiner.config.deployment;
    for control_loop in loops(deployment) {
        let ControlLoop { name, bandwidth_hz, .. } = control_loop;
        // Both bandwidths of the legs are those of the position.
        let axis = if name == "orientation" { name } else { "position" };
        if let Some(pole) = control_loop.beyond_held_pole() {
            examiner.error("limits.condition", format!("{}", deployment.limits.condition), pole);
            break;
        }
        if let Some(warning) = control_loop.warning() {
            examiner.warn(&format!("control.{axis}_bandwidth_hz"), format!("{bandwidth_hz}"), warning);
        }
    }
    let (control, noise_m) = (&deployment.control, deployment.noise.length_m);
    let period_s = deployment.realtime.period_s();
    let optimum_hz = optimum_hz(control.disturbance_m_s2_per_sqrt_s, noise_m, period_s);
    if control.estimator_bandwidth_hz > optimum_hz {
        let bound = format!(
            "must be less: this noise needs an estimator of {:.2} Hz, and no loop with one as slow is stable; check its unit",
            optimum_hz
        );
        examiner.error("measured.length_noise_m", format!("{noise_m}"), bound);
    }
    let Some((timeout_ms, age_ms)) = unstable_timeout_ms(deployment) else { return };
    let bound = format!(
        "must be at most {:.1}, the largest age of measurements with which the loop is stable: older ones are refused when they \
         arrive, and without any the platform is not controlled for so long",
        (10.0 * age_ms).floor() / 10.0
    );
    let (key, value) = ("timeouts.measured_ms", format!("{timeout_ms}"));
    if deployment.timeouts.allow_unstable_age {
        examiner.warn(key, value, bound + "; accepted, as timeouts.allow_unstable_age is true");
    } else {
        let remedy = "; lower it or the bandwidths; for simulated hardware timeouts.allow_unstable_age = true accepts it";
        examiner.error(key, value, bound + remedy);
    }
}

/// Line of a key, else of its section, else 1. Legs count from 1, as in `leg[3].platform_m`.
fn line_of(text: &str, key: &str) -> usize {
    let (table, _) = DeTable::parse_recoverable(text);
    let mut parts = key.split('.');
    let Some(first) = parts.next() else { return 1 };
    let (name, index) = first.split_once('[').unwrap_or((first, ""));
    let Some(mut found) = table.get_ref().get(name) else { return 1 };
    let index: Option<usize> = index.trim_end_matches(']').parse().ok();
    let row = |value: &'_ Spanned<DeValue<'_>>, index: usize| {
        value.get_ref().as_array().and_then(|rows| rows.get(index.wrapping_sub(1)).map(Spanned::span))
    };
    if let Some(span) = index.and_then(|index| row(found, index)) {
        return line_at(text, span.start);
    }
    for part in parts {
        let Some(next) = found.get_ref().as_table().and_then(|table| table.get(part)) else { break };
        found = next;
    }
    line_at(text, found.span().start)
}

#[cfg(test)]
mod tests {
    use super::line_of;

    #[test]
    fn lines_are_those_of_keys_else_of_their_sections() {
        let text = "name = \"x\"\n[control]\nmode = 1\n[[leg]]\na = 1\n[[leg]]\nb = 2\n";
        for (key, line) in [
            ("name", 1),
            ("control.mode", 3),
            ("control", 2),
            ("control.none", 2),
            ("leg[2].b", 6),
            ("none", 1),
        ] {
            assert_eq!(line_of(text, key), line, "{key}");
        }
    }
}
