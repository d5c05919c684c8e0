//! What must hold for every machine and every motion: identities, derivatives, invariances.
//!
//! Machines are those of `tests/data` with every parameter disturbed; motions start near home.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod dynamics;
mod frames;
mod invariance;
mod kinematics;
mod layouts;
mod moving_base;
mod regressor;
mod rotations;
mod stances;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::*;

/// Where a tolerance is multiplied by the condition number, worse poses would say nothing.
const WORST_CONDITION: f64 = 100.0;

/// The same cases in every run; a failure prints the machine and the motion.
fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(2008),
        ..ProptestConfig::default()
    }
}

/// A number of magnitude up to one.
fn unit() -> impl Strategy<Value = f64> {
    -1.0..1.0f64
}

fn vector3() -> impl Strategy<Value = Vector3<f64>> {
    [unit(), unit(), unit()].prop_map(Vector3::from)
}

fn vector6() -> impl Strategy<Value = Vector6<f64>> {
    [unit(), unit(), unit(), unit(), unit(), unit()].prop_map(Vector6::from)
}

/// A direction, evenly enough distributed.
fn direction() -> impl Strategy<Value = Vector3<f64>> {
    vector3().prop_filter("too short", |v| v.norm() > 0.1).prop_map(|v| v.normalize())
}

fn rotation() -> impl Strategy<Value = Matrix3<f64>> {
    [-3.1..3.1f64, -3.1..3.1, -3.1..3.1].prop_map(|[a, b, c]| hexad_support::rotation(a, b, c))
}

/// The six legs' vectors of a machine, disturbed by up to `size` each.
fn disturbed(legs: &[Vector3<f64>; LEGS], by: &[Vector3<f64>; LEGS], size: f64) -> [Vector3<f64>; LEGS] {
    core::array::from_fn(|i| legs[i] + by[i] * size)
}

fn heavier(link: &Link, mass: f64, axial: f64, quadratic: f64) -> Link {
    let mut link = link.clone();
    link.mass_kg *= mass;
    link.center_of_mass_m *= 0.5 + 0.5 * mass;
    link.axial_inertia_kg_m2 = axial * link.transverse_inertia.constant_kg_m2;
    link.transverse_inertia.quadratic_kg += quadratic * link.mass_kg;
    link
}

/// A machine no two of whose parameters are alike. Spin is often large, friction is there.
fn any_machine() -> impl Strategy<Value = Machine> {
    static SOUND: LazyLock<Vec<Machine>> = LazyLock::new(|| MACHINES.map(machine).to_vec());
    let legs = || [vector3(), vector3(), vector3(), vector3(), vector3(), vector3()];
    let axes = [direction(), direction(), direction(), direction(), direction(), direction()];
    let factors = [0.6..1.5f64, 0.6..1.5, 0.6..1.5];
    let links = [0.0..1.0f64, 0.0..1.0, 0.0..0.2, 0.0..0.2];
    let drive = [0.0..1.0f64, 0.0..1.0, 0.0..1.0];
    (0..MACHINES.len(), (legs(), legs(), axes), factors, links, drive, (vector3(), direction())).prop_map(
        |(which, (base, platform, axes), [body, cylinder, rod], links, drive, (offset, gravity))| {
            let mut machine = SOUND[which].clone();
            let radius = machine.joints.radius_m;
            let legs = Legs::of(&machine);
            let legs = Legs {
                base: disturbed(&legs.base, &base, 0.05 * radius),
                platform: disturbed(&legs.platform, &platform, 0.05 * radius),
                universal_axis: axes,
            };
            machine.joints = legs.joints(&machine.home);
            machine.gravity_m_s2 = gravity * 9.81;
            machine.platform.mass_kg *= body;
            machine.platform.center_of_mass_m += offset * (0.2 * radius);
            machine.cylinder = heavier(&machine.cylinder, cylinder, links[0], links[2]);
            machine.rod = heavier(&machine.rod, rod, links[1], links[3]);
            let mass = machine.platform.mass_kg;
            machine.actuator.reflected_mass_kg = 0.3 * mass * drive[0];
            machine.actuator.viscous_friction_n_s_m =
                core::array::from_fn(|leg| mass * drive[1] * (1.0 + 0.1 * leg as f64));
            machine.actuator.coulomb_friction_n =
                core::array::from_fn(|leg| mass * drive[2] * (1.0 - 0.1 * leg as f64));
            machine
        },
    )
}

/// A state near home: 10 degrees and 15 % of the radius away, at up to 2 rad/s and 20 rad/s^2 per axis.
fn state_near_home(machine: &Machine, [x, xd, xdd]: &[Vector6<f64>; 3]) -> TaskState {
    let r = machine.joints.radius_m;
    let size = |angle: f64, share: f64| {
        let length = share * r;
        Vector6::new(angle, angle, angle, length, length, length)
    };
    TaskState {
        x: Vector6::from(machine.home) + x.component_mul(&size(0.17, 0.15)),
        xd: xd.component_mul(&size(2.0, 2.0)),
        xdd: xdd.component_mul(&size(20.0, 20.0)),
    }
}

/// A machine, a state of it and its motion, where the pose is well conditioned and no leg within asin(0.2)
/// of the first axis of its universal joint, where the spin is singular.
fn machine_in_motion() -> impl Strategy<Value = (Machine, TaskState, Motion)> {
    (any_machine(), [vector6(), vector6(), vector6()])
        .prop_map(|(machine, at)| {
            let state = state_near_home(&machine, &at);
            (machine, state, state.motion())
        })
        .prop_filter("near a singularity", |(machine, _, motion)| {
            let n = leg_directions(machine, &motion.pose);
            let u = Legs::of(machine).universal_axis;
            let sines = n.iter().zip(&u).map(|(n, u)| n.cross(u).norm());
            sines.fold(1.0, f64::min) > 0.2 && condition(machine, &motion.pose) < WORST_CONDITION
        })
}

/// Largest difference, as a share of the largest of `b`.
fn relative(a: &[f64], b: &[f64]) -> f64 {
    let difference: Vec<_> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    largest(&difference) / largest(b).max(f64::MIN_POSITIVE)
}
