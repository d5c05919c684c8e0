//! Values of the new machine file.

use nalgebra::{Matrix3, Vector3};

use super::quantities::{BODY_QUANTITIES, LEG_QUANTITIES, Quantity};
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

const CENTER: &str = "platform.center_of_mass_m";

/// Transverse inertia of a link: its key, and the link.
type Across = (&'static str, fn(&Machine) -> &Link);
const ACROSS: [Across; 2] = [
    ("cylinder.transverse_inertia_kg_m2", |machine| &machine.cylinder),
    ("rod.transverse_inertia_kg_m2", |machine| &machine.rod),
];

/// All values of an identified machine, for its file. With `has_payload` the payload is a part of the platform.
pub(super) fn new_values(
    text: &str,
    found: &Identification,
    has_payload: bool,
    delay: &Delay,
) -> Vec<NewValue> {
    let estimate = |of: &dyn Fn(&Machine) -> f64| {
        let estimated = found.estimate(|machine, payload| {
            let none = Platform { mass_kg: 0.0, ..payload.clone() };
            let platform = joined(machine, if has_payload { payload } else { &none });
            of(&Machine { platform, ..machine.clone() })
        });
        Estimate { value: estimated.value, deviation: estimated.deviation }
    };
    let one = |key: &str, of: &dyn Fn(&Machine) -> f64| NewValue {
        key: key.into(),
        value: NewNumbers::One(estimate(of)),
    };
    let array = |key: &str, length: usize, of: &dyn Fn(&Machine, usize) -> f64| NewValue {
        key: key.into(),
        value: NewNumbers::Array((0..length).map(|k| estimate(&|machine| of(machine, k))).collect()),
    };
    // Neither combinations nor components of an array.
    let numbers = BODY_QUANTITIES.iter().filter(|quantity| !quantity.name.contains([' ', '[']));
    let number = |quantity: &Quantity| {
        one(quantity.name, &|machine: &Machine| (quantity.value)(machine, &machine.platform))
    };
    let mut values: Vec<_> = numbers.map(number).collect();
    values.push(array(CENTER, 3, &|machine, axis| {
        machine.platform.center_of_mass_m.get(axis).copied().unwrap_or_default()
    }));
    for (key, link) in ACROSS {
        // Of a table, the constant part.
        let constant = if has_table(text, key) { format!("{key}.constant_kg_m2") } else { key.into() };
        values.push(one(&constant, &|machine: &Machine| link(machine).transverse_inertia.constant_kg_m2));
    }
    for (key, _, of) in LEG_QUANTITIES {
        values.push(array(key, LEGS, &|machine, leg| of(machine).get(leg).copied().unwrap_or_default()));
    }
    let unstated = Estimate { value: unstated_friction(found), deviation: 0.0 };
    values.push(NewValue { key: "actuator.friction_uncertainty_n".into(), value: NewNumbers::One(unstated) });
    if let Some(shown) = delay.shown {
        let delay_s = (shown.mean.delay_s - delay.lag_s).max(0.0);
        let value = Estimate { value: 1e6 * delay_s, deviation: 1e6 * shown.mean.deviation_s };
        values.push(NewValue { key: "drive.delay_us".into(), value: NewNumbers::One(value) });
    }
    values
}

/// Platform and payload as one body.
fn joined(machine: &Machine, payload: &Platform) -> Platform {
    let platform = &machine.platform;
    let mass_kg = platform.mass_kg + payload.mass_kg;
    let center_of_mass_m =
        (platform.center_of_mass_m * platform.mass_kg + payload.center_of_mass_m * payload.mass_kg) / mass_kg;
    let about = |body: &Platform| {
        let r: Vector3<f64> = body.center_of_mass_m - center_of_mass_m;
        let point = Matrix3::identity() * r.norm_squared() - r * r.transpose();
        (if body.mass_kg > 0.0 { body.inertia } else { Matrix3::zeros() }) + point * body.mass_kg
    };
    Platform { mass_kg, center_of_mass_m, inertia: about(platform) + about(payload) }
}

/// Friction that the new file may lack \[N\], rounded up.
fn unstated_friction(found: &Identification) -> f64 {
    let machine = &found.machine;
    let home = TaskState::at_rest(machine.home).motion();
    let held = inverse_dynamics::<Gravity>(machine, &home).unwrap_or_default();
    let actuator = &machine.actuator;
    let legs = actuator
        .coulomb_friction_n
        .iter()
        .zip(&actuator.load_friction_share)
        .zip(held)
        .zip(&found.residual_n);
    let rest = legs.map(|(((coulomb, load), held), residual)| {
        STICTION_RATIO * (coulomb + load * held.abs()) + RESIDUALS * residual
    });
    let rest = rest.fold(0.0, f64::max);
    let step = 10_f64.powf(rest.max(f64::MIN_POSITIVE).log10().floor() - 1.0);
    (rest / step).ceil() * step
}
