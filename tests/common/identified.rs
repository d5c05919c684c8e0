//! Machines that are not what their files say, and motions that show it.

use hexad::analysis::identification::Identification;
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::task::TaskState;
use nalgebra::{Matrix3, Vector3, Vector6};

/// A machine whose file is up to 30 % off, with drives of their own.
pub fn drawn(file: &Machine, random: &mut Random) -> Machine {
    let mut off = |ratio: f64| 1.0 + ratio * random.signed();
    let mut machine = file.clone();
    let (platform, actuator) = (&mut machine.platform, &mut machine.actuator);
    platform.mass *= off(0.3);
    platform.center_of_mass += Vector3::from_fn(|_, _| 0.1 * file.joints.radius * (off(1.0) - 1.0));
    platform.inertia *= off(0.3);
    machine.rod.mass *= off(0.1);
    actuator.reflected_mass = (actuator.reflected_mass + 0.01 * file.platform.mass) * off(0.3);
    let most = actuator.max_force;
    actuator.coulomb_friction = core::array::from_fn(|_| 0.008 * most * off(0.5));
    actuator.viscous_friction = core::array::from_fn(|_| 0.02 * most / actuator.max_rate * off(0.5));
    actuator.load_friction = core::array::from_fn(|_| 0.015 * off(0.9));
    actuator.force_scale = core::array::from_fn(|_| off(0.05));
    machine
}

/// The machine with a point mass on its platform.
pub fn loaded(machine: &Machine, mass: f64, at: Vector3<f64>) -> Machine {
    let mut loaded = machine.clone();
    let body = &machine.platform;
    let total = body.mass + mass;
    let center = (body.center_of_mass * body.mass + at * mass) / total;
    let about =
        |r: Vector3<f64>, mass: f64| (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * mass;
    loaded.platform.inertia =
        body.inertia + about(body.center_of_mass - center, body.mass) + about(at - center, mass);
    (loaded.platform.mass, loaded.platform.center_of_mass) = (total, center);
    loaded
}

/// Sines of five frequencies on every axis.
pub struct Series {
    cosine: [Vector6<f64>; 5],
    sine: [Vector6<f64>; 5],
}

impl Series {
    pub fn new(machine: &Machine, share: f64, random: &mut Random) -> Self {
        let r = machine.joints.radius;
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

pub fn report(found: &Identification, truth: &Machine) {
    let show = |name: &str, quantity: &dyn Fn(&Machine) -> f64| {
        let estimate = found.estimate(|machine, _| quantity(machine));
        println!(
            "{name:12} {:.5} +- {:.5}, true {:.5}, {:.1} deviations; was {:.4} +- {:.4}",
            estimate.value,
            estimate.deviation,
            quantity(truth),
            (estimate.value - quantity(truth)) / estimate.deviation,
            estimate.before,
            estimate.expected
        );
    };
    show("m", &|machine| machine.platform.mass);
    show("m + 6 m2", &|machine| machine.platform.mass + 6.0 * machine.rod.mass);
    show("x", &|machine| machine.platform.center_of_mass.x);
    show("z", &|machine| machine.platform.center_of_mass.z);
    show("Ixx", &|machine| machine.platform.inertia.m11);
    show("Ixy", &|machine| machine.platform.inertia.m12);
    show("m2", &|machine| machine.rod.mass);
    show("reflected", &|machine| machine.actuator.reflected_mass);
    for leg in 0..6 {
        show("viscous", &|machine| machine.actuator.viscous_friction[leg]);
        show("Coulomb", &|machine| machine.actuator.coulomb_friction[leg]);
        show("load", &|machine| machine.actuator.load_friction[leg]);
        show("scale", &|machine| machine.actuator.force_scale[leg]);
    }
}
