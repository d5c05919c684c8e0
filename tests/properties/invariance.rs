//! What the forces must not depend on: the choice of axes, of units, of leg numbers, of instructions.

use fearless_simd::Level;

use super::*;

fn forces(machine: &Machine, motion: &Motion) -> [f64; LEGS] {
    inverse_dynamics::<Exact>(machine, motion).unwrap()
}

/// Base axes turned by `q` and their origin moved by `d`: the same machine in the same motion.
fn moved_base(machine: &Machine, motion: &Motion, q: &Matrix3<f64>, d: &Vector3<f64>) -> (Machine, Motion) {
    let legs = Legs::of(machine);
    let legs = Legs {
        base: legs.base.map(|a| q * a + d),
        universal_axis: legs.universal_axis.map(|u| q * u),
        ..legs
    };
    let machine = Machine {
        gravity_m_s2: q * machine.gravity_m_s2,
        joints: legs.joints(&machine.home),
        ..machine.clone()
    };
    let Motion { pose, twist, acceleration } = motion;
    let motion = Motion {
        pose: Pose { rotation: q * pose.rotation, position: q * pose.position + d },
        twist: Twist { angular: q * twist.angular, linear: q * twist.linear },
        acceleration: Acceleration { angular: q * acceleration.angular, linear: q * acceleration.linear },
    };
    (machine, motion)
}

/// Platform axes turned by `q` and their origin moved by `d` (in platform axes): the same machine in the
/// same motion, with C another point of the platform.
fn moved_platform(
    machine: &Machine,
    motion: &Motion,
    q: &Matrix3<f64>,
    d: &Vector3<f64>,
) -> (Machine, Motion) {
    let mut result = machine.clone();
    let of_new = |v: Vector3<f64>| q.tr_mul(&(v - d));
    let legs = Legs::of(machine);
    result.joints = Legs { platform: legs.platform.map(of_new), ..legs }.joints(&result.home);
    result.platform.center_of_mass_m = of_new(machine.platform.center_of_mass_m);
    result.platform.inertia = q.transpose() * machine.platform.inertia * q;
    let tool = Pose { rotation: *q, position: *d };
    (result, Frames { tool, ..Frames::default() }.tool_motion(motion))
}

/// Lengths times `s`, masses times `m`, times times `t`: forces are `m s / t^2` as large.
fn rescaled(machine: &Machine, motion: &Motion, s: f64, m: f64, t: f64) -> (Machine, Motion) {
    let mut result = machine.clone();
    result.gravity_m_s2 *= s / (t * t);
    let legs = Legs::of(machine);
    let scaled = |legs: [Vector3<f64>; LEGS]| legs.map(|v| v * s);
    result.joints =
        Legs { base: scaled(legs.base), platform: scaled(legs.platform), ..legs }.joints(&result.home);
    result.platform.mass_kg *= m;
    result.platform.center_of_mass_m *= s;
    result.platform.inertia *= m * s * s;
    for link in [&mut result.cylinder, &mut result.rod] {
        let Link { mass_kg, center_of_mass_m, axial_inertia_kg_m2, transverse_inertia } = link;
        *mass_kg *= m;
        *center_of_mass_m *= s;
        *axial_inertia_kg_m2 *= m * s * s;
        transverse_inertia.constant_kg_m2 *= m * s * s;
        transverse_inertia.quadratic_kg *= m;
        transverse_inertia.reference_length_m *= s;
    }
    let actuator = &mut result.actuator;
    actuator.reflected_mass_kg *= m;
    actuator.viscous_friction_n_s_m = actuator.viscous_friction_n_s_m.map(|friction| friction * m / t);
    actuator.coulomb_friction_n = actuator.coulomb_friction_n.map(|friction| friction * m * s / (t * t));
    actuator.coulomb_smoothing_m_s *= s / t;
    let Motion { pose, twist, acceleration } = motion;
    let motion = Motion {
        pose: Pose { rotation: pose.rotation, position: pose.position * s },
        twist: Twist { angular: twist.angular / t, linear: twist.linear * (s / t) },
        acceleration: Acceleration {
            angular: acceleration.angular / (t * t),
            linear: acceleration.linear * (s / (t * t)),
        },
    };
    (result, motion)
}

/// Every instruction set this processor has.
fn levels() -> Vec<Level> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let others = [
        best.as_sse2().map(Level::Sse2),
        best.as_sse4_2().map(Level::Sse4_2),
        best.as_avx2().map(Level::Avx2),
        best.as_avx512().map(Level::Avx512),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let others = [];
    [Some(Level::baseline()), Some(best)].into_iter().chain(others).flatten().collect()
}

/// The bits of what the lanes compute: forces of every fidelity, legs, condition, and the pose of the legs found from another.
fn all_results(machine: &Machine, motion: &Motion, start: &Pose) -> Vec<u64> {
    let legs = leg_motion(machine, motion);
    let fidelities = [
        inverse_dynamics::<Exact>(machine, motion),
        inverse_dynamics::<RigidLegs>(machine, motion),
        inverse_dynamics::<NoVelocity>(machine, motion),
        inverse_dynamics::<LumpedLegs>(machine, motion),
        inverse_dynamics::<MasslessLegs>(machine, motion),
    ];
    let mut state = KinematicState::new(machine, *start);
    let report = refine(machine, &mut state, &legs.length_m);
    let found = state.pose();
    let found = found.rotation.iter().chain(found.position.iter()).chain([&report.step_ratio]);
    let forces = fidelities.iter().flatten().flatten();
    let legs = [&legs.length_m, &legs.rate_m_s, &legs.accel_m_s2].into_iter().flatten();
    let condition = condition(machine, &motion.pose);
    forces.chain(legs).chain(found).chain([&condition]).map(|number| number.to_bits()).collect()
}

proptest! {
    #![proptest_config(cases(1000))]

    #[test]
    fn base_axes_do_not_matter((machine, _, motion) in machine_in_motion(), q in rotation(), d in vector3()) {
        let (other, other_motion) = moved_base(&machine, &motion, &q, &(d * machine.joints.radius_m));
        prop_assert!(relative(&forces(&other, &other_motion), &forces(&machine, &motion)) < 1e-11);
    }

    #[test]
    fn platform_axes_do_not_matter((machine, _, motion) in machine_in_motion(), q in rotation(), d in vector3()) {
        let (other, other_motion) = moved_platform(&machine, &motion, &q, &(d * machine.joints.radius_m));
        prop_assert!((other.joints.radius_m / machine.joints.radius_m - 1.0).abs() < 1e-13);
        prop_assert!(relative(&forces(&other, &other_motion), &forces(&machine, &motion)) < 1e-11);
    }

    #[test]
    fn units_do_not_matter(
        (machine, _, motion) in machine_in_motion(),
        s in 0.1..10.0f64,
        m in 0.1..10.0f64,
        t in 0.1..10.0f64,
    ) {
        let (other, other_motion) = rescaled(&machine, &motion, s, m, t);
        let expected = forces(&machine, &motion).map(|force| force * m * s / (t * t));
        prop_assert!(relative(&forces(&other, &other_motion), &expected) < 1e-12);
        prop_assert!((other.joints.radius_m / (s * machine.joints.radius_m) - 1.0).abs() < 1e-14);
        let k = condition(&machine, &motion.pose);
        prop_assert!((condition(&other, &other_motion.pose) / k - 1.0).abs() < 1e-14 * k);
    }

    #[test]
    fn leg_numbers_do_not_matter(
        (machine, _, motion) in machine_in_motion(),
        order in Just([0, 1, 2, 3, 4, 5]).prop_shuffle(),
    ) {
        let mut other = machine.clone();
        let legs = Legs::of(&machine);
        let legs = Legs {
            base: order.map(|leg| legs.base[leg]),
            platform: order.map(|leg| legs.platform[leg]),
            universal_axis: order.map(|leg| legs.universal_axis[leg]),
        };
        other.joints = legs.joints(&other.home);
        for friction in [&mut other.actuator.viscous_friction_n_s_m, &mut other.actuator.coulomb_friction_n] {
            *friction = order.map(|leg| friction[leg]);
        }
        let expected = order.map(|leg| forces(&machine, &motion)[leg]);
        prop_assert!(relative(&forces(&other, &motion), &expected) < 1e-12);
        let expected = order.map(|leg| leg_motion(&machine, &motion).accel_m_s2[leg]);
        prop_assert_eq!(leg_motion(&other, &motion).accel_m_s2, expected, "a lane is a lane");
    }

    /// To the bit: a recording is replayed on another processor. SSE4.2 rounds products on their own.
    #[test]
    fn instruction_sets_do_not_matter((machine, _, motion) in machine_in_motion(), off in vector3()) {
        let reference = Machine { level: Level::baseline(), ..machine.clone() };
        let start = Pose { position: motion.pose.position + off * (1e-3 * machine.joints.radius_m), ..motion.pose };
        for level in levels() {
            let other = Machine { level, ..machine.clone() };
            if matches!(format!("{level:?}"), name if name.starts_with("Sse4_2")) {
                prop_assert!(relative(&forces(&other, &motion), &forces(&reference, &motion)) < 1e-12);
                continue;
            }
            prop_assert_eq!(all_results(&other, &motion, &start), all_results(&reference, &motion, &start), "{:?}", level);
        }
    }
}
