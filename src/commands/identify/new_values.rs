//! Values of the new machine file.

use nalgebra::{Matrix3, Vector3};

use super::report::Delay;
use crate::commands::machine_file::{Estimate, NewNumbers, NewValue, has_table};
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::inverse_dynamics;
use hexad_core::model::fidelity::Gravity;
use hexad_core::model::machine::{Link, Machine, Platform};
use hexad_core::model::task::TaskState;
use hexad_machine::analysis::identification::Identification;

/// Friction that the new file may still lack: this ratio of the largest dry friction at home, for stiction, and so many RMS
/// residuals.
const STICTION_RATIO: f64 = 0.5;
const RESIDUALS: f64 = 3.0;

type Path = &'static [&'static str];
type Number = fn(&Machine, &Platform) -> f64;

/// Numbers of the links and of the drives.
const NUMBERS: [(Path, Number); 6] = [
    (&["cylinder", "center_of_mass_m"], |machine, _| machine.cylinder.center_of_mass),
    (&["cylinder", "axial_inertia_kg_m2"], |machine, _| machine.cylinder.axial_inertia),
    (&["rod", "mass_kg"], |machine, _| machine.rod.mass),
    (&["rod", "center_of_mass_m"], |machine, _| machine.rod.center_of_mass),
    (&["rod", "axial_inertia_kg_m2"], |machine, _| machine.rod.axial_inertia),
    (&["actuator", "reflected_mass_kg"], |machine, _| machine.actuator.reflected_mass),
];

/// Numbers of the platform, with the payload.
const PLATFORM: [(Path, Number); 7] = [
    (&["platform", "mass_kg"], |machine, payload| joined(machine, payload).mass),
    (&["platform", "inertia_kg_m2", "xx"], |machine, payload| joined(machine, payload).inertia.m11),
    (&["platform", "inertia_kg_m2", "yy"], |machine, payload| joined(machine, payload).inertia.m22),
    (&["platform", "inertia_kg_m2", "zz"], |machine, payload| joined(machine, payload).inertia.m33),
    (&["platform", "inertia_kg_m2", "xy"], |machine, payload| joined(machine, payload).inertia.m12),
    (&["platform", "inertia_kg_m2", "xz"], |machine, payload| joined(machine, payload).inertia.m13),
    (&["platform", "inertia_kg_m2", "yz"], |machine, payload| joined(machine, payload).inertia.m23),
];
const CENTER: Path = &["platform", "center_of_mass_m"];

/// Transverse inertia of a link: its key, the key of its constant part where the file has a table, and the link.
type Across = (Path, Path, fn(&Machine) -> &Link);
const ACROSS: [Across; 2] = [
    (
        &["cylinder", "transverse_inertia_kg_m2"],
        &["cylinder", "transverse_inertia_kg_m2", "constant_kg_m2"],
        |machine| &machine.cylinder,
    ),
    (
        &["rod", "transverse_inertia_kg_m2"],
        &["rod", "transverse_inertia_kg_m2", "constant_kg_m2"],
        |machine| &machine.rod,
    ),
];

type OfLegs = fn(&Machine) -> &[f64; LEGS];
const OF_LEGS: [(Path, OfLegs); 4] = [
    (&["actuator", "viscous_friction_n_s_m"], |machine| &machine.actuator.viscous_friction),
    (&["actuator", "coulomb_friction_n"], |machine| &machine.actuator.coulomb_friction),
    (&["actuator", "load_friction"], |machine| &machine.actuator.load_friction),
    (&["actuator", "force_scale"], |machine| &machine.actuator.force_scale),
];

/// All values of an identified machine, for its file. With `has_payload` the payload is a part of the platform.
pub(super) fn new_values(
    text: &str,
    found: &Identification,
    has_payload: bool,
    delay: &Delay,
) -> Vec<NewValue> {
    let estimate = |of: &dyn Fn(&Machine, &Platform) -> f64| {
        let estimated = found.estimate(|machine, payload| {
            let none = Platform { mass: 0.0, ..payload.clone() };
            of(machine, if has_payload { payload } else { &none })
        });
        Estimate { value: estimated.value, deviation: estimated.deviation }
    };
    let one = |path: Path, of: &dyn Fn(&Machine, &Platform) -> f64| NewValue {
        path,
        value: NewNumbers::One(estimate(of)),
    };
    let array = |path: Path, length: usize, of: &dyn Fn(&Machine, &Platform, usize) -> f64| NewValue {
        path,
        value: NewNumbers::Array(
            (0..length).map(|k| estimate(&|machine, payload| of(machine, payload, k))).collect(),
        ),
    };
    let mut values: Vec<_> = PLATFORM.iter().chain(&NUMBERS).map(|(path, of)| one(path, of)).collect();
    values.push(array(CENTER, 3, &|machine, payload, axis| {
        joined(machine, payload).center_of_mass.get(axis).copied().unwrap_or_default()
    }));
    for (path, constant, link) in ACROSS {
        let path = if has_table(text, path) { constant } else { path };
        values.push(one(path, &|machine: &Machine, _: &Platform| link(machine).transverse_inertia.constant));
    }
    for (path, of) in OF_LEGS {
        values.push(array(path, LEGS, &|machine, _, leg| of(machine).get(leg).copied().unwrap_or_default()));
    }
    let unstated = Estimate { value: unstated_friction(found), deviation: 0.0 };
    values.push(NewValue { path: &["actuator", "friction_uncertainty_n"], value: NewNumbers::One(unstated) });
    if let Some(shown) = delay.shown {
        let delay_s = (shown.mean.delay_s - delay.lag_s).max(0.0);
        let value = Estimate { value: 1e6 * delay_s, deviation: 1e6 * shown.mean.deviation_s };
        values.push(NewValue { path: &["drive", "delay_us"], value: NewNumbers::One(value) });
    }
    values
}

/// Platform and payload as one body.
fn joined(machine: &Machine, payload: &Platform) -> Platform {
    let platform = &machine.platform;
    let mass = platform.mass + payload.mass;
    let center_of_mass =
        (platform.center_of_mass * platform.mass + payload.center_of_mass * payload.mass) / mass;
    let about = |body: &Platform| {
        let r: Vector3<f64> = body.center_of_mass - center_of_mass;
        let point = Matrix3::identity() * r.norm_squared() - r * r.transpose();
        (if body.mass > 0.0 { body.inertia } else { Matrix3::zeros() }) + point * body.mass
    };
    Platform { mass, center_of_mass, inertia: about(platform) + about(payload) }
}

/// Friction that the new file may lack \[N\], rounded up.
fn unstated_friction(found: &Identification) -> f64 {
    let machine = &found.machine;
    let home = TaskState::at_rest(machine.home).motion();
    let held = inverse_dynamics::<Gravity>(machine, &home).unwrap_or_default();
    let actuator = &machine.actuator;
    let legs = actuator.coulomb_friction.iter().zip(&actuator.load_friction).zip(held).zip(&found.residual);
    let rest = legs.map(|(((coulomb, load), held), residual)| {
        STICTION_RATIO * (coulomb + load * held.abs()) + RESIDUALS * residual
    });
    let rest = rest.fold(0.0, f64::max);
    let step = 10_f64.powf(rest.max(f64::MIN_POSITIVE).log10().floor() - 1.0);
    (rest / step).ceil() * step
}
