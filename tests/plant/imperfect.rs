//! Forces that the model does not have, each against what it must do by the laws of mechanics.

use super::energy::worked;
use super::*;

/// A machine in space whose drives only push.
fn floating(name: &str) -> Machine {
    let mut machine = without_drives(machine(name));
    machine.gravity_m_s2.fill(0.0);
    machine.rod.transverse_inertia.quadratic_kg = 0.0;
    machine
}

/// A payload is a point with the force `m (a - g)`: the wrench it adds about C is known without any inertia tensor.
#[test]
fn a_payload_needs_the_forces_of_a_point_mass() {
    let build =
        BuildErrors { payload_kg: 2.5, payload_at_m: Vector3::new(0.2, -0.1, 0.3), joint_deviation_m: 0.0 };
    assert_each_within(1e-12, "with payload, wrench", &MACHINES, |machine, motion| {
        let Motion { pose, twist: Twist { angular, .. }, acceleration } = motion;
        let loaded = build.built(machine, &mut Random::new(0));
        let arm = pose.rotation * build.payload_at_m;
        let accelerates =
            acceleration.linear + acceleration.angular.cross(&arm) + angular.cross(&angular.cross(&arm));
        let force = (accelerates - machine.gravity_m_s2) * build.payload_kg;
        let n = leg_wrenches(machine, pose);
        let total = |machine| n * Vector6::from(inverse_dynamics::<Exact>(machine, motion).unwrap());
        let expected = Wrench { torque: arm.cross(&force), force }.vector();
        (total(&loaded) - total(machine) - expected).amax() / total(&loaded).amax()
    });
}

#[test]
fn an_external_wrench_acts_on_the_platform_at_its_origin() {
    let wrench = Wrench { torque: Vector3::new(3.0, -5.0, 2.0), force: Vector3::new(-20.0, 10.0, 30.0) };
    let machines = ["motion_base", "fried2008", "tilted"];
    assert_each_within(1e-11, "acceleration under a wrench", &machines, |machine, motion| {
        let (dynamics, Motion { pose, twist, .. }) = (ForwardDynamics::new(machine), motion);
        let force = [12.0; LEGS];
        let n = leg_wrenches(machine, pose);
        let as_legs = n.lu().solve(&wrench.vector()).unwrap() + Vector6::from(force);
        let found = dynamics.acceleration_under(pose, twist, &force, &wrench).unwrap().vector();
        let expected = dynamics.acceleration(pose, twist, &as_legs.into()).unwrap().vector();
        (found - expected).amax() / expected.amax()
    });
}

/// A platform in space that a cosine pushes along z: its velocity is a sine.
#[test]
fn an_external_wrench_swings() {
    let machine = floating("motion_base");
    let mut wanted = Imperfections::default();
    wanted.external.wrench.force = Vector3::new(0.0, 0.0, 500.0);
    wanted.external.frequency_hz = 10.0;
    let mut simulator = simulator(&machine, &wanted);
    let start = simulator.state().pose;
    // Brakes hold it, while its time goes on.
    simulator.advance(0.1, None);
    assert_eq!(simulator.state().pose, start);
    let w = TAU * 10.0;
    let dynamics = ForwardDynamics::new(&machine);
    let accelerates = dynamics
        .acceleration_under(&start, &Twist::default(), &[0.0; LEGS], &wanted.external.wrench)
        .unwrap();
    let mut errors = Errors::default();
    for k in 1..=100 {
        simulator.advance(1e-3, Some(&[0.0; LEGS]));
        let expected = accelerates.linear.z / w * (w * 1e-3 * f64::from(k)).sin();
        errors.add((simulator.state().twist.linear.z - expected) / (accelerates.linear.z / w));
    }
    // The platform moves 0.1 mm: so little changes its mass.
    errors.assert_within(1e-3, "velocity under a swinging force");
}

#[test]
fn stiction_is_there_at_rest_and_gone_at_speed() {
    let friction =
        Friction { viscous_n_s_m: 10.0, coulomb_n: 4.0, stiction_n: 3.0, stribeck_speed_m_s: 0.01 };
    for sign in [-1.0, 1.0] {
        for (rate, expected) in [
            (0.0, 0.0),
            (0.5e-4, 5e-4 + 0.5 * 7.0),
            (1e-4, 1e-3 + 4.0 + 3.0 * (-1e-4_f64).exp()),
            (0.01, 0.1 + 4.0 + 3.0 / core::f64::consts::E),
            (0.1, 1.0 + 4.0),
        ] {
            let found = friction.force(sign * rate, 1e-4);
            assert!((found - sign * expected).abs() < 1e-3, "{rate}: {found} {expected}");
        }
    }
}

/// A push between sliding and breaking-loose friction holds from rest and does not stop what moves.
#[test]
fn a_leg_sticks_until_it_breaks_loose() {
    let machine = floating("motion_base");
    let friction = Friction { coulomb_n: 200.0, stiction_n: 300.0, ..Friction::default() };
    let wanted = Imperfections { friction, ..Imperfections::default() };
    let mut simulator = simulator(&machine, &wanted);
    let smoothing = simulator.machine().actuator.coulomb_smoothing_m_s;
    for _ in 0..500 {
        simulator.advance(1e-3, Some(&[450.0; LEGS]));
        let fastest = largest(&simulator.leg_motion().rate_m_s);
        assert!(fastest < smoothing, "it creeps at most: {fastest} of {smoothing}");
    }
    simulator.advance(0.02, Some(&[800.0; LEGS]));
    let loose = largest(&simulator.leg_motion().rate_m_s);
    assert!(loose > 2.0 * Friction::STRIBECK_SPEED_M_S, "{loose}");
    simulator.advance(0.05, Some(&[450.0; LEGS]));
    let after = largest(&simulator.leg_motion().rate_m_s);
    assert!(after > 1.2 * loose, "it goes on: {loose} {after}");
}

/// What friction takes is force times way.
#[test]
fn friction_dissipates_what_it_should() {
    let machine = floating("motion_base");
    let friction =
        Friction { viscous_n_s_m: 300.0, coulomb_n: 100.0, stiction_n: 150.0, stribeck_speed_m_s: 0.02 };
    let mut simulator = simulator(&machine, &Imperfections { friction, ..Imperfections::default() });
    simulator.advance(0.1, Some(&[2000.0; LEGS]));
    let power =
        |rates: [f64; LEGS]| -rates.iter().map(|rate| rate * friction.force(*rate, 1e-9)).sum::<f64>();
    let (start, gained, put_in) = worked(&machine, &mut simulator, 100, &[0.0; LEGS], power);
    assert!(gained < -0.1 * start && (gained / put_in - 1.0).abs() < 1e-6, "{gained} {put_in}");
}

/// With the lag w, the way under a constant push is that of a push that came 1 / w later.
#[test]
fn a_lag_delays_the_force() {
    let machine = floating("motion_base");
    let mut wanted = Imperfections::default();
    wanted.drive.bandwidth_hz = Some(50.0);
    let mut simulator = simulator(&machine, &wanted);
    assert!(simulator.terms().lag_per_s.is_some());
    let w = TAU * 50.0;
    let push = [300.0; LEGS];
    let start = home(&machine);
    let accelerates = ForwardDynamics::new(&machine).acceleration(&start.pose, &start.twist, &push).unwrap();
    let mut errors = Errors::default();
    for k in 1..=50 {
        simulator.advance(1e-3, Some(&push));
        let t = 1e-3 * f64::from(k);
        let expected = accelerates.linear.z * (t - (1.0 - (-w * t).exp()) / w);
        errors.add((simulator.state().twist.linear.z - expected) / (accelerates.linear.z * 0.05));
    }
    errors.assert_within(1e-3, "velocity behind a lag");
    // A brake takes the force away: after it, the push begins at nothing again.
    simulator.advance(1.0, None);
    let before = *simulator.state();
    simulator.advance(1e-3, Some(&push));
    let gained = simulator.state().twist.linear.z - before.twist.linear.z;
    let share = gained / (accelerates.linear.z * 1e-3);
    assert!((0.1..0.2).contains(&share), "{share}");
}

/// Hardware with everything wrong at once is still a machine: it stays in bounds and stops when it must.
#[test]
fn everything_at_once_still_stops() {
    let machine = machine("motion_base");
    let wanted = everything();
    let mut hardware = hardware(&machine, &wanted);
    let motion = Motion {
        pose: home(&machine).pose,
        twist: Twist::default(),
        acceleration: Acceleration { linear: Vector3::z(), ..Acceleration::default() },
    };
    let push = inverse_dynamics::<Exact>(&machine, &motion).unwrap();
    for k in 0..300 {
        hardware.advance(1_000_000, (k < 200).then_some(push));
        let (lengths, rates) = hardware.measure();
        assert!(lengths.iter().chain(&rates).all(|value| value.is_finite()));
    }
    let state = *hardware.simulator().state();
    assert_eq!(state.twist, Twist::default());
    assert!(state.pose.displacement_to(&home(&machine).pose).vector().norm() > 1e-3, "it had moved");
}
