//! A moving base, against Lagrange's equations in inertial space and against the choice of the base.

use hexad::model::moving_base::BaseMotion;

use super::*;

/// Turns that are large beside those of a ship, so that every term counts \[rad/s\], \[rad/s^2\], \[m/s^2\].
fn turning(velocity: &Vector3<f64>, acceleration: &Vector3<f64>, gravity: &Vector3<f64>) -> BaseMotion {
    BaseMotion {
        gravity_m_s2: gravity * 9.81,
        angular_velocity_rad_s: velocity * 3.0,
        angular_acceleration_rad_s2: acceleration * 20.0,
    }
}

/// Kinetic energy in inertial space, of a machine without friction: every body from its velocity and angular velocity. `base` is the
/// motion of the base at the instant, with the velocity of its origin.
fn kinetic_energy(machine: &Machine, state: &TaskState, omega: &Vector3<f64>, origin: &Vector3<f64>) -> f64 {
    let Motion { pose, twist, .. } = state.motion();
    let Legs { base, platform, universal_axis } = Legs::of(machine);
    let point = |mass: f64, p: Vector3<f64>, v: Vector3<f64>| {
        0.5 * mass * (origin + omega.cross(&p) + v).norm_squared()
    };
    let body = |inertia: Matrix3<f64>, w: Vector3<f64>| 0.5 * (w + omega).dot(&(inertia * (w + omega)));
    let arm = pose.rotation * machine.platform.center_of_mass_m;
    let inertia = pose.rotation * machine.platform.inertia * pose.rotation.transpose();
    let mut sum =
        point(machine.platform.mass_kg, pose.position + arm, twist.linear + twist.angular.cross(&arm))
            + body(inertia, twist.angular);
    for ((a, b), u) in base.iter().zip(&platform).zip(&universal_axis) {
        let b = pose.rotation * b;
        let velocity = twist.linear + twist.angular.cross(&b);
        let span = pose.position + b - a;
        let (length, n) = (span.norm(), span.normalize());
        let rate = velocity.dot(&n);
        let n_rate = (velocity - n * rate) / length;
        let k = u.cross(&n);
        let w = n.cross(&n_rate) + n * (u.dot(&n) * n_rate.dot(&k) / k.norm_squared());
        sum += 0.5 * machine.actuator.reflected_mass_kg * rate * rate;
        for (link, at, along) in [
            (&machine.cylinder, machine.cylinder.center_of_mass_m, 0.0),
            (&machine.rod, length - machine.rod.center_of_mass_m, rate),
        ] {
            let across = link.transverse_inertia.at(length);
            let inertia =
                Matrix3::identity() * across + n * n.transpose() * (link.axial_inertia_kg_m2 - across);
            sum += point(link.mass_kg, a + n * at, n_rate * at + n * along) + body(inertia, w);
        }
    }
    sum
}

/// Fourth-order difference of a function at 0.
fn slope<T: core::ops::Sub<Output = T> + core::ops::Mul<f64, Output = T>>(
    step: f64,
    f: impl Fn(f64) -> T,
) -> T {
    ((f(step) - f(-step)) * 8.0 - (f(2.0 * step) - f(-2.0 * step))) * (1.0 / (12.0 * step))
}

proptest! {
    #![proptest_config(cases(200))]

    /// `d/dt dT/dX' - dT/dX + dV/dX = sum of Gamma_i dL_i/dX`, with T in inertial space. The equations know nothing of the model: neither
    /// its decomposition nor N.
    #[test]
    fn forces_on_a_moving_base_satisfy_lagrange(
        (mut machine, state, _) in machine_in_motion(),
        velocity in vector3(), acceleration in vector3(), gravity in direction(), rising in vector3(),
    ) {
        let actuator = &mut machine.actuator;
        (actuator.viscous_friction_n_s_m, actuator.coulomb_friction_n) = ([0.0; 6], [0.0; 6]);
        // The paper's inertia that varies with the length lacks the terms of its change.
        machine.cylinder.transverse_inertia.quadratic_kg = 0.0;
        machine.rod.transverse_inertia.quadratic_kg = 0.0;
        let base = turning(&velocity, &acceleration, &gravity);
        let motion = state.motion();
        let forces = InverseDynamics::new(&machine).forces_on(&motion, &base).unwrap();
        // Base axes at the time t, first order: Omega, and the velocity of the origin, in base axes. Of its acceleration and of gravity only
        // the difference counts: gravity is zero here.
        let omega = |t: f64| base.angular_velocity_rad_s + base.angular_acceleration_rad_s2 * t;
        let start = rising * 2.0;
        let origin = |t: f64| start + (-base.gravity_m_s2 - base.angular_velocity_rad_s.cross(&start)) * t;
        let at = |t: f64| TaskState { x: state.x + state.xd * t + state.xdd * (0.5 * t * t), xd: state.xd + state.xdd * t, xdd: state.xdd };
        let r = machine.joints.radius_m;
        for axis in 0..6 {
            let unit = Vector6::ith(axis, if axis < 3 { 1.0 } else { r });
            let momentum = |t: f64| {
                let energy = |share: f64| {
                    let state = at(t);
                    kinetic_energy(&machine, &TaskState { xd: state.xd + unit * share, ..state }, &omega(t), &origin(t))
                };
                0.5 * (energy(1.0) - energy(-1.0))
            };
            let by_place = slope(1e-3, |share| {
                kinetic_energy(&machine, &TaskState { x: state.x + unit * share, ..state }, &omega(0.0), &origin(0.0))
            });
            let required = slope(1e-3, momentum) - by_place;
            let by_legs = slope(1e-3, |share| {
                let pose = TaskState { x: state.x + unit * share, ..state }.motion().pose;
                Vector6::from(leg_lengths(&machine, &pose)).dot(&Vector6::from(forces))
            });
            let size = r * Vector6::from(forces).norm();
            prop_assert!((by_legs - required).abs() < 1e-6 * size, "{axis}: {by_legs} {required} of {size}");
        }
    }

    /// Base and gravity turned together are the same machine; so is one whose acceleration replaces its gravity.
    #[test]
    fn gravity_of_the_base_replaces_that_of_the_machine((machine, _, motion) in machine_in_motion(), gravity in direction()) {
        let gravity_m_s2 = gravity * 9.81;
        let expected = inverse_dynamics::<Exact>(&Machine { gravity_m_s2, ..machine.clone() }, &motion).unwrap();
        let model = InverseDynamics::new(&machine);
        prop_assert_eq!(model.forces_under::<Exact>(&motion, &gravity_m_s2).unwrap(), expected);
        let mut lanes = [None; 3];
        model.forces_of_all_under(Fidelity::Exact, &[motion; 3], &gravity_m_s2, &mut lanes);
        for found in lanes {
            let error = Vector6::from(found.unwrap()) - Vector6::from(expected);
            prop_assert!(error.amax() <= 1e-9 * Vector6::from(expected).amax());
        }
        let base = BaseMotion { gravity_m_s2, ..BaseMotion::default() };
        prop_assert_eq!(model.forces_on(&motion, &base).unwrap(), expected);
    }

    /// At rest on a base that turns, on legs without mass, the platform is one body that turns with the base: Newton and Euler.
    #[test]
    fn a_base_that_turns_with_its_platform_is_one_body((machine, _, motion) in machine_in_motion(), velocity in vector3()) {
        let omega = velocity * 3.0;
        let pose = motion.pose;
        let rest = Motion { pose, twist: Twist::default(), acceleration: Acceleration::default() };
        let mut light = machine;
        (light.cylinder.mass_kg, light.rod.mass_kg) = (0.0, 0.0);
        for link in [&mut light.cylinder, &mut light.rod] {
link.axial_inertia_kg_m2 = 0.0;
            (link.transverse_inertia.constant_kg_m2, link.transverse_inertia.quadratic_kg) = (0.0, 0.0);
        }
        let base = BaseMotion { angular_velocity_rad_s: omega, ..BaseMotion::default() };
        let forces = InverseDynamics::new(&light).forces_on(&rest, &base).unwrap();
        let body = &light.platform;
        let arm = pose.rotation * body.center_of_mass_m;
        let force = omega.cross(&omega.cross(&(pose.position + arm))) * body.mass_kg;
        let inertia = pose.rotation * body.inertia * pose.rotation.transpose();
        let torque = arm.cross(&force) + omega.cross(&(inertia * omega));
        let wrench = leg_wrenches(&light, &pose) * Vector6::from(forces);
        let expected = Vector6::from_iterator(torque.iter().chain(&force).copied());
        prop_assert!((wrench - expected).amax() < 1e-9 * (1.0 + Vector6::from(forces).amax()));
    }
}
