//! Machines that are not what their files say, and motions that show it.

use hexad::analysis::identification::{Estimated, Identification};
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::task::TaskState;
use nalgebra::{Matrix3, Vector3, Vector6};

/// A machine whose file is up to 30 % off, with drives of their own.
pub fn drawn(file: &Machine, random: &mut Random) -> Machine {
    let mut off = |ratio: f64| 1.0 + ratio * random.signed();
    let mut machine = file.clone();
    let (platform, actuator) = (&mut machine.platform, &mut machine.actuator);
    platform.mass_kg *= off(0.3);
    platform.center_of_mass_m += Vector3::from_fn(|_, _| 0.1 * file.joints.radius_m * (off(1.0) - 1.0));
    platform.inertia *= off(0.3);
    machine.rod.mass_kg *= off(0.1);
    actuator.reflected_mass_kg = (actuator.reflected_mass_kg + 0.01 * file.platform.mass_kg) * off(0.3);
    let most = actuator.max_force_n;
    actuator.coulomb_friction_n = core::array::from_fn(|_| 0.008 * most * off(0.5));
    actuator.viscous_friction_n_s_m =
        core::array::from_fn(|_| 0.02 * most / actuator.max_rate_m_s * off(0.5));
    actuator.load_friction_share = core::array::from_fn(|_| 0.015 * off(0.9));
    actuator.force_scale = core::array::from_fn(|_| off(0.05));
    machine
}

/// The machine with a point mass on its platform.
pub fn loaded(machine: &Machine, mass: f64, at: Vector3<f64>) -> Machine {
    let mut loaded = machine.clone();
    let body = &machine.platform;
    let total = body.mass_kg + mass;
    let center = (body.center_of_mass_m * body.mass_kg + at * mass) / total;
    let about =
        |r: Vector3<f64>, mass: f64| (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * mass;
    loaded.platform.inertia =
        body.inertia + about(body.center_of_mass_m - center, body.mass_kg) + about(at - center, mass);
    (loaded.platform.mass_kg, loaded.platform.center_of_mass_m) = (total, center);
    loaded
}

/// Sines of five frequencies on every axis.
pub struct Series {
    cosine: [Vector6<f64>; 5],
    sine: [Vector6<f64>; 5],
}

impl Series {
    pub fn new(machine: &Machine, share: f64, random: &mut Random) -> Self {
        let r = machine.joints.radius_m;
        let size = Vector6::new(0.08, 0.08, 0.08, 0.05 * r, 0.05 * r, 0.05 * r) * share;
        let mut draw = || core::array::from_fn(|_| size.map(|size| size * random.signed()));
        Self { cosine: draw(), sine: draw() }
    }

    pub fn at(&self, machine: &Machine, t: f64) -> TaskState {
        let mut state = TaskState::at_rest(machine.home);
        for (k, (cosine, sine)) in self.cosine.iter().zip(&self.sine).enumerate() {
            let w = core::f64::consts::TAU * 0.1 * (k + 1) as f64;
            let (s, c) = (w * t).sin_cos();
            state.x += cosine * c + sine * s;
            state.xd += (sine * c - cosine * s) * w;
            state.xdd -= (cosine * c + sine * s) * (w * w);
        }
        state
    }
}

/// Largest error of a parameter in its own deviations.
pub fn worst_error(found: &Identification, truth: &Machine) -> f64 {
    errors(found, truth).into_iter().fold(0.0, |worst, error| worst.max(error.abs()))
}

/// Error of each parameter in its own deviations.
pub fn errors(found: &Identification, truth: &Machine) -> Vec<f64> {
    let mut errors = vec![];
    let mut check = |name: &str, of: &dyn Fn(&Machine) -> f64| {
        let Estimated { value, deviation, .. } = found.estimate(|machine, _| of(machine));
        let error = (value - of(truth)) / deviation;
        println!("{name:20} {value:.5} +- {deviation:.5}, true {:.5}: {error:.1} deviations", of(truth));
        errors.push(error);
    };
    check("mass", &|machine| machine.platform.mass_kg);
    check("mass with rods", &|machine| machine.platform.mass_kg + 6.0 * machine.rod.mass_kg);
    for axis in 0..3 {
        check("centre of mass", &|machine| machine.platform.center_of_mass_m[axis]);
        check("moment of inertia", &|machine| machine.platform.inertia[(axis, axis)]);
    }
    check("product of inertia", &|machine| machine.platform.inertia.m12);
    check("rod", &|machine| machine.rod.mass_kg);
    check("reflected mass", &|machine| machine.actuator.reflected_mass_kg);
    for leg in 0..6 {
        check("viscous friction", &|machine| machine.actuator.viscous_friction_n_s_m[leg]);
        check("Coulomb friction", &|machine| machine.actuator.coulomb_friction_n[leg]);
        check("load friction", &|machine| machine.actuator.load_friction_share[leg]);
        check("force scale", &|machine| machine.actuator.force_scale[leg]);
    }
    errors
}
