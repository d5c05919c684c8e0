//! Identities of the inverse dynamics of one machine.

use hexad::model::transmission::Transmission;

use super::*;

fn forces(machine: &Machine, motion: &Motion) -> Vector6<f64> {
    inverse_dynamics::<Exact>(machine, motion).unwrap().into()
}

proptest! {
    #![proptest_config(cases(1000))]

    #[test]
    fn forces_are_linear_in_the_acceleration(
        (machine, _, motion) in machine_in_motion(),
        other in vector6(),
        share in -3.0..3.0f64,
    ) {
        let r = machine.joints.radius_m;
        let other = other.component_mul(&Vector6::new(20.0, 20.0, 20.0, 20.0 * r, 20.0 * r, 20.0 * r));
        let one = motion.acceleration.vector();
        let with = |a: Vector6<f64>| {
            forces(&machine, &Motion { acceleration: Acceleration::from_vector(&a), ..motion })
        };
        let mixed = with(one * share + other * (1.0 - share));
        let expected = with(one) * share + with(other) * (1.0 - share);
        let scale = with(one).amax() * share.abs() + with(other).amax() * (1.0 - share).abs();
        prop_assert!((mixed - expected).amax() < 1e-12 * scale);
    }

    /// Power of the actuators is power of the wrench, plus what the drives keep: `Gamma . L' = W . twist`.
    #[test]
    fn power_is_the_same_in_legs_and_in_the_platform((machine, _, motion) in machine_in_motion()) {
        let load = InverseDynamics::new(&machine).load_of::<Exact>(&motion);
        let rates = Vector6::from(leg_motion(&machine, &motion).rate_m_s);
        let gamma = forces(&machine, &motion);
        let power = (gamma - load.axial_forces_n).dot(&rates);
        let expected = load.wrench.dot(&motion.twist.vector());
        let scale = (gamma - load.axial_forces_n).component_mul(&rates).abs().sum();
        prop_assert!((power - expected).abs() < 1e-12 * scale, "{power} {expected}");
        prop_assert_eq!(load.leg_wrenches, leg_wrenches(&machine, &motion.pose));
    }

    /// At rest the forces are what gravity does to the bodies: the gradient of the potential.
    #[test]
    fn forces_at_rest_balance_gravity((machine, _, motion) in machine_in_motion()) {
        let rest = Motion { twist: Twist::default(), acceleration: Acceleration::default(), ..motion };
        let wrench = leg_wrenches(&machine, &rest.pose) * forces(&machine, &rest);
        let (h, r) = (1e-4 * machine.joints.radius_m, machine.joints.radius_m);
        for k in 0..6 {
            let step = Vector6::ith(k, if k < 3 { h / r } else { h });
            let at = |sign: f64| potential(&machine, &rest.pose.displaced(&Twist::from_vector(&(step * sign))));
            let slope = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / 12.0;
            let work = wrench.dot(&step);
            let scale = 9.81 * machine.platform.mass_kg * h;
            prop_assert!((slope - work).abs() < 1e-8 * scale, "{k}: {slope} {work}");
        }
    }

    /// A motion run backwards through the same poses needs the same forces, friction aside.
    #[test]
    fn time_can_be_reversed((mut machine, _, motion) in machine_in_motion()) {
        (machine.actuator.viscous_friction_n_s_m, machine.actuator.coulomb_friction_n) = ([0.0; 6], [0.0; 6]);
        let Twist { angular, linear } = motion.twist;
        let back = Motion { twist: Twist { angular: -angular, linear: -linear }, ..motion };
        prop_assert!(relative(forces(&machine, &back).as_slice(), forces(&machine, &motion).as_slice()) < 1e-12);
    }

    #[test]
    fn without_axial_inertia_the_models_agree((mut machine, _, motion) in machine_in_motion()) {
        let spinning = forces(&machine, &motion);
        (machine.cylinder.axial_inertia_kg_m2, machine.rod.axial_inertia_kg_m2) = (0.0, 0.0);
        let exact = forces(&machine, &motion);
        prop_assert_eq!(&exact, &Vector6::from(inverse_dynamics::<RigidLegs>(&machine, &motion).unwrap()));
        prop_assert!(relative(spinning.as_slice(), exact.as_slice()) > 1e-9, "the spin costs something");
    }

    /// What a leg gets of a command, by the definition; and the command for it.
    #[test]
    fn commands_are_the_inverse_of_transmission(
        (mut machine, _, motion) in machine_in_motion(),
        commands in vector6(),
        scale in vector6(),
        load in vector6(),
    ) {
        machine.actuator.force_scale = scale.map(|scale| 1.2 + 0.7 * scale).into();
        machine.actuator.load_friction_share = load.map(|load| 0.4 * (1.0 + load)).into();
        let transmission = Transmission::of_motion(&machine, &motion);
        let forces = transmission.leg_forces(&commands.into());
        let (legs, actuator) = (leg_motion(&machine, &motion), &machine.actuator);
        for i in 0..6 {
            let own = actuator.force_scale[i] * commands[i];
            let sign = (legs.rate_m_s[i] / actuator.coulomb_smoothing_m_s).clamp(-1.0, 1.0);
            let expected = own - actuator.load_friction_share[i] * own.abs() * sign;
            prop_assert!((forces[i] - expected).abs() <= 1e-12 * own.abs());
        }
        let back = Vector6::from(transmission.commands(&forces));
        prop_assert!((back - commands).amax() < 1e-12);
        // Whatever the rates, the available force takes no more than the largest command.
        for force in [actuator.weakest_available_force_n(), -actuator.weakest_available_force_n()] {
            let most = transmission.commands(&[force; 6]).into_iter().map(f64::abs).fold(0.0, f64::max);
            prop_assert!(most <= actuator.max_force_n * (1.0 + 1e-12));
        }
    }
}

/// Potential of all thirteen bodies.
fn potential(machine: &Machine, pose: &Pose) -> f64 {
    let height = |mass: f64, at: &Vector3<f64>| -mass * machine.gravity_m_s2.dot(at);
    let Legs { base, platform, .. } = Legs::of(machine);
    let body = &machine.platform;
    let mut sum = height(body.mass_kg, &(pose.position + pose.rotation * body.center_of_mass_m));
    for (a, b) in base.iter().zip(&platform) {
        let b = pose.position + pose.rotation * b;
        let n = (b - a).normalize();
        sum += height(machine.cylinder.mass_kg, &(a + n * machine.cylinder.center_of_mass_m));
        sum += height(machine.rod.mass_kg, &(b - n * machine.rod.center_of_mass_m));
    }
    sum
}
