//! Quantities that the identification shows: keys of the machine file, and combinations that are known better than their
//! parts.

use hexad_core::model::LEGS;
use hexad_core::model::machine::{Machine, Platform};
use hexad_core::model::regressor::VISCOUS;

/// A number of machine and payload.
pub(super) struct Quantity {
    /// Key of the machine file, or what a combination is.
    pub name: &'static str,
    pub unit: &'static str,
    pub value: fn(&Machine, &Platform) -> f64,
}

const fn quantity(name: &'static str, unit: &'static str, value: fn(&Machine, &Platform) -> f64) -> Quantity {
    Quantity { name, unit, value }
}

/// Of the platform, the links and all drives.
pub(super) const BODY_QUANTITIES: [Quantity; 18] = [
    quantity("platform.mass_kg", "kg", |machine, _| machine.platform.mass_kg),
    quantity("platform with six rods", "kg", |machine, _| {
        machine.platform.mass_kg + LEGS as f64 * machine.rod.mass_kg
    }),
    quantity("platform.center_of_mass_m[1]", "m", |machine, _| machine.platform.center_of_mass_m.x),
    quantity("platform.center_of_mass_m[2]", "m", |machine, _| machine.platform.center_of_mass_m.y),
    quantity("platform.center_of_mass_m[3]", "m", |machine, _| machine.platform.center_of_mass_m.z),
    quantity("platform.inertia_kg_m2.xx", "kg m^2", |machine, _| machine.platform.inertia.m11),
    quantity("platform.inertia_kg_m2.yy", "kg m^2", |machine, _| machine.platform.inertia.m22),
    quantity("platform.inertia_kg_m2.zz", "kg m^2", |machine, _| machine.platform.inertia.m33),
    quantity("platform.inertia_kg_m2.xy", "kg m^2", |machine, _| machine.platform.inertia.m12),
    quantity("platform.inertia_kg_m2.xz", "kg m^2", |machine, _| machine.platform.inertia.m13),
    quantity("platform.inertia_kg_m2.yz", "kg m^2", |machine, _| machine.platform.inertia.m23),
    quantity("cylinder.center_of_mass_m", "m", |machine, _| machine.cylinder.center_of_mass_m),
    quantity("cylinder.axial_inertia_kg_m2", "kg m^2", |machine, _| machine.cylinder.axial_inertia_kg_m2),
    quantity("rod.mass_kg", "kg", |machine, _| machine.rod.mass_kg),
    quantity("rod.center_of_mass_m", "m", |machine, _| machine.rod.center_of_mass_m),
    quantity("rod.axial_inertia_kg_m2", "kg m^2", |machine, _| machine.rod.axial_inertia_kg_m2),
    quantity("transverse inertia of both links", "kg m^2", |machine, _| {
        machine.cylinder.transverse_inertia.constant_kg_m2 + machine.rod.transverse_inertia.constant_kg_m2
    }),
    quantity("actuator.reflected_mass_kg", "kg", |machine, _| machine.actuator.reflected_mass_kg),
];

/// Of the payload.
pub(super) const PAYLOAD: [Quantity; 4] = [
    quantity("payload: mass", "kg", |_, payload| payload.mass_kg),
    quantity("payload: centre of mass x", "m", |_, payload| payload.center_of_mass_m.x),
    quantity("payload: centre of mass y", "m", |_, payload| payload.center_of_mass_m.y),
    quantity("payload: centre of mass z", "m", |_, payload| payload.center_of_mass_m.z),
];

/// Names of the base parameters up to the reflected mass, by their index in the regressor.
const BASE_PARAMETERS: [&str; VISCOUS] = [
    "mass",
    "moment_x",
    "moment_y",
    "moment_z",
    "inertia_xx",
    "inertia_yy",
    "inertia_zz",
    "inertia_xy",
    "inertia_xz",
    "inertia_yz",
    "cylinder_moment",
    "transverse_inertia",
    "axial_inertia",
    "quadratic_inertia",
    "rod_mass",
    "rod_moment",
    "rod_transverse_inertia",
    "rod_axial_inertia",
    "rod_quadratic_inertia",
    "reflected_mass",
];
/// Of each leg.
const LEG_PARAMETERS: [&str; 4] =
    ["viscous_friction", "coulomb_friction", "force_scale", "scaled_load_friction"];

/// Name of a base parameter.
pub(super) fn base_parameter(index: usize) -> String {
    let of_leg = |offset: usize| {
        let name = LEG_PARAMETERS.get(offset / LEGS).map(|name| format!("{name}_{}", offset % LEGS + 1));
        let payload = || {
            BASE_PARAMETERS.get(offset - LEG_PARAMETERS.len() * LEGS).map(|name| format!("payload_{name}"))
        };
        name.or_else(payload)
    };
    let name = BASE_PARAMETERS.get(index).map(|name| (*name).to_owned());
    name.or_else(|| of_leg(index - VISCOUS)).unwrap_or_default()
}

/// A number of each leg: key of the machine file, unit, values.
pub(super) type LegQuantity = (&'static str, &'static str, fn(&Machine) -> &[f64; LEGS]);

/// Of each drive.
pub(super) const LEG_QUANTITIES: [LegQuantity; 4] = [
    ("actuator.viscous_friction_n_s_m", "N s/m", |machine| &machine.actuator.viscous_friction_n_s_m),
    ("actuator.coulomb_friction_n", "N", |machine| &machine.actuator.coulomb_friction_n),
    ("actuator.load_friction", "", |machine| &machine.actuator.load_friction_share),
    ("actuator.force_scale", "", |machine| &machine.actuator.force_scale),
];
