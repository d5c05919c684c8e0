//! The machine as its file says it, read without the library.

use nalgebra::{Matrix3, Vector3};
use toml::{Table, Value};

use crate::data;

#[derive(Clone)]
pub struct Body {
    pub mass: f64,
    /// CG
    pub center_of_mass: Vector3<f64>,
    /// About the centre of mass.
    pub inertia: Matrix3<f64>,
}

/// `constant + quadratic (L - reference_length)^2`
#[derive(Clone, Copy)]
pub struct TransverseInertia {
    pub constant: f64,
    pub quadratic: f64,
    pub reference_length: f64,
}

impl TransverseInertia {
    pub fn at(&self, length: f64) -> f64 {
        self.constant + self.quadratic * (length - self.reference_length).powi(2)
    }

    /// dI/dL
    pub fn slope(&self, length: f64) -> f64 {
        2.0 * self.quadratic * (length - self.reference_length)
    }
}

/// Cylinder or rod.
#[derive(Clone, Copy)]
pub struct Link {
    pub mass: f64,
    /// From A toward B for the cylinder, from B toward A for the rod.
    pub center_of_mass: f64,
    pub axial_inertia: f64,
    pub transverse_inertia: TransverseInertia,
}

/// What the drives add to the paper's forces.
#[derive(Clone, Default)]
pub struct Drive {
    pub reflected_mass: f64,
    pub viscous_friction: f64,
    pub coulomb_friction: f64,
}

/// Joint centres and the first axis of the universal joint.
#[derive(Clone, Copy)]
pub struct Joints {
    pub base: Vector3<f64>,
    pub platform: Vector3<f64>,
    pub universal_axis: Vector3<f64>,
}

#[derive(Clone)]
pub struct Machine {
    pub gravity: Vector3<f64>,
    pub platform: Body,
    pub cylinder: Link,
    pub rod: Link,
    pub drive: Drive,
    pub joints: [Joints; 6],
}

impl Machine {
    pub fn load(name: &str) -> Self {
        let file: Table = std::fs::read_to_string(data(name, "toml")).unwrap().parse().unwrap();
        let section = |key: &str| file[key].as_table().unwrap();
        let actuator = section("actuator");
        let optional = |key: &str| actuator.get(key).map_or(0.0, number);
        let legs = file["leg"].as_array().unwrap();
        Self {
            gravity: vector(&file["gravity_m_s2"]),
            platform: body(section("platform")),
            cylinder: link(section("cylinder")),
            rod: link(section("rod")),
            drive: Drive {
                reflected_mass: optional("reflected_mass_kg"),
                viscous_friction: optional("viscous_friction_n_s_m"),
                coulomb_friction: optional("coulomb_friction_n"),
            },
            joints: core::array::from_fn(|i| Joints {
                base: vector(&legs[i]["base_m"]),
                platform: vector(&legs[i]["platform_m"]),
                universal_axis: legs[i].get("universal_axis").map_or(Vector3::y(), vector).normalize(),
            }),
        }
    }
}

fn body(table: &Table) -> Body {
    let inertia = table["inertia_kg_m2"].as_table().unwrap();
    let [xx, yy, zz, xy, xz, yz] =
        ["xx", "yy", "zz", "xy", "xz", "yz"].map(|key| inertia.get(key).map_or(0.0, number));
    Body {
        mass: number(&table["mass_kg"]),
        center_of_mass: vector(&table["center_of_mass_m"]),
        inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    }
}

fn link(table: &Table) -> Link {
    let transverse = &table["transverse_inertia_kg_m2"];
    let transverse_inertia = match transverse.as_table() {
        None => TransverseInertia { constant: number(transverse), quadratic: 0.0, reference_length: 0.0 },
        Some(of_length) => TransverseInertia {
            constant: number(&of_length["constant_kg_m2"]),
            quadratic: number(&of_length["quadratic_kg"]),
            reference_length: number(&of_length["reference_length_m"]),
        },
    };
    Link {
        mass: number(&table["mass_kg"]),
        center_of_mass: number(&table["center_of_mass_m"]),
        axial_inertia: number(&table["axial_inertia_kg_m2"]),
        transverse_inertia,
    }
}

fn number(value: &Value) -> f64 {
    value.as_float().unwrap_or_else(|| value.as_integer().unwrap() as f64)
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(value.as_array().unwrap().iter().map(number))
}
