//! Legs at their worst: through the axis of their universal joint, next to no length, next to parallel.

use hexad::config::deployment::FidelityChoice;

use super::*;

/// The motion base with the universal joint of its first leg turned so that the leg passes its first axis at this
/// angle when the platform moves along the vector, which is normal to the leg.
fn through_axis(beside: f64) -> (Config, Vector3<f64>) {
    let mut config = deployed("motion_base");
    let machine = &mut config.machine;
    let n = leg_directions(machine, &machine.home_pose())[0];
    let along = n.cross(&Vector3::z()).normalize();
    let mut legs = Legs::of(machine);
    legs.universal_axis[0] = n * beside.cos() + n.cross(&along) * beside.sin();
    machine.joints = legs.joints(&machine.home);
    (config, along)
}

/// What the spin of the legs adds to the force on the platform \[N\], at most, while it moves along the vector with
/// `SPEED` past the axis.
fn spin_at_most(beside: f64) -> f64 {
    let (config, along) = through_axis(beside);
    let machine = &config.machine;
    let dynamics = InverseDynamics::new(machine);
    let at = |share: f64| {
        let mut pose = machine.home_pose();
        pose.position += along * (share * beside * leg_lengths(machine, &machine.home_pose())[0]);
        let twist = Twist { angular: Vector3::zeros(), linear: along * SPEED };
        let motion = Motion { pose, twist, acceleration: Acceleration::default() };
        let spin =
            dynamics.load_of::<Exact>(&motion).total() - dynamics.load_of::<RigidLegs>(&motion).total();
        spin.fixed_rows::<3>(3).norm()
    };
    (-300..=300).map(|k| at(0.01 * f64::from(k))).fold(0.0, f64::max)
}

/// Of the platform across the leg \[m/s\].
const SPEED: f64 = 0.3;

/// A leg that passes the axis at an angle e, with v radians per second, has to spin by nearly half a turn in a time
/// of e / v: with the inertia Ix that takes `0.572 Ix v^2 / (e^3 L)` at the joint on the platform. The exact fidelity says
/// so, the others know of no spin; at the axis itself nothing turns it.
#[test]
fn beside_the_axis_of_its_joint_a_leg_spins_as_predicted() {
    let machine = deployed("motion_base").machine;
    let length = leg_lengths(&machine, &machine.home_pose())[0];
    let inertia = machine.cylinder.axial_inertia_kg_m2 + machine.rod.axial_inertia_kg_m2;
    let predicted = |e: f64| 0.572_433 * inertia * (SPEED / length).powi(2) / (e.powi(3) * length);
    for beside in [1e-2, 1e-3, 1e-4, 1e-5] {
        let ratio = spin_at_most(beside) / predicted(beside);
        assert!((ratio - 1.0).abs() < 3.0 * beside + 1e-3, "{beside:e}: {ratio}");
    }
    // Nearer than the model looks, and through it.
    for beside in [1e-7, 1e-9, 0.0] {
        let most = spin_at_most(beside);
        assert!(most < predicted(1e-6), "{beside:e}: {most} N");
    }
}

/// The drives cannot do that. From a home that is so near to the axis the exact fidelity asks for it and is cut, and says so; the
/// rigid-legs fidelity does not know, and feedback asks. The reference leads no leg through the axis, whatever the fidelity: it comes to rest.
#[test]
fn the_reference_comes_to_rest_before_the_axis_of_a_joint() {
    for (fidelity, beside) in
        [Fidelity::Exact, Fidelity::RigidLegs].into_iter().flat_map(|r| [1e-2, 1e-3, 1e-5].map(|e| (r, e)))
    {
        let (mut config, along) = through_axis(beside);
        config.deployment.control.fidelity = FidelityChoice::Fixed(fidelity);
        // Forces are what is limited here, and not feedback.
        config.deployment.limits.feedback_scale = 1e6;
        // On the machine that is controlled the joint gives way, and the force for a spin that it does not need looks like a payload
        // or an impact.
        config.deployment.limits.payload_change_kg = Some(f64::INFINITY);
        config.deployment.limits.disturbance_step_m_s2 = Some(f64::INFINITY);
        let mut rig = Rig::new(&config, &deployed("motion_base").machine);
        rig.engage(&TaskState::at_rest(config.machine.home));
        let (mut cut, mut most, mut has_stopped) = (0, 0.0_f64, false);
        for k in 0..2000 {
            let (t, w) = (f64::from(k) * 1e-3, TAU * 0.5);
            let mut task = TaskState::at_rest(config.machine.home);
            // From rest at home, in the middle through it at half a metre per second, and back to rest there.
            let ((s, c), (s2, c2)) = ((w * t).sin_cos(), (2.0 * w * t).sin_cos());
            let (x, v, a) = (s - 0.5 * s2, w * (c - c2), w * w * (2.0 * s2 - s));
            for (value, share) in [(&mut task.x, x), (&mut task.xd, v), (&mut task.xdd, a)] {
                *value += Vector6::new(0.0, 0.0, 0.0, along.x, along.y, along.z) * (0.08 * share);
            }
            let output = rig.cycle(&rig.input(&task));
            if output.diagnostic.code == DiagnosticCode::MeasurementImplausible {
                // The cut forces leave the platform where no disturbance of the model's size explains it.
                assert!(cut > 0, "{fidelity:?} {beside:e}");
                has_stopped = true;
                break;
            }
            if output.state != State::Active {
                assert_eq!(output.diagnostic.code, DiagnosticCode::SetpointBeyondLimits, "{beside:e}");
                has_stopped = true;
            }
            cut += u32::from(
                output.active_limits.contains(Limit::Force)
                    || output.active_limits.contains(Limit::ForceRate),
            );
            most = most.max(largest(&output.command_n));
        }
        assert!(most <= config.machine.actuator.max_force_n);
        assert_eq!([cut > 0, has_stopped], [beside < 1e-2; 2], "{fidelity:?} {beside:e}: {cut} cycles");
    }
}

/// The motion base with the first joint on its base so near to that on the platform at home.
fn with_short_leg(length: f64) -> Machine {
    let mut machine = deployed("motion_base").machine;
    let at_home = machine.home_pose();
    let n = leg_directions(&machine, &at_home)[0];
    let mut legs = Legs::of(&machine);
    legs.base[0] = at_home.position + at_home.rotation * legs.platform[0] - n * length;
    machine.joints = legs.joints(&machine.home);
    machine
}

/// A leg turns by a radian when its end moves by its length: nothing is trusted further than a share of it. What
/// directions have to do with forces is exact to rounding over the length; a leg with mass turns ever faster, and its
/// weight has ever less of an arm.
#[test]
fn a_leg_of_next_to_no_length_loses_what_its_length_says() {
    let trusted = |length: f64| {
        let machine = with_short_leg(length);
        KinematicState::new(&machine, machine.home_pose()).sensitivity().trusted_step / length
    };
    let forces = |length: f64| {
        let machine = with_short_leg(length);
        let motion = TaskState::at_rest(machine.home).motion();
        let dynamics = InverseDynamics::new(&machine);
        (dynamics.forces::<MasslessLegs>(&motion).unwrap(), dynamics.forces::<Exact>(&motion).unwrap())
    };
    let apart =
        |a: &[f64; 6], b: &[f64; 6]| largest(&core::array::from_fn::<_, 6, _>(|i| a[i] - b[i])) / largest(b);
    let (small, (massless, heavy)) = (trusted(1e-4), (forces(1.0).0, largest(&forces(1e-4).1) * 1e-4));
    for power in 3..=10 {
        let length = 10_f64.powi(-power);
        assert!((trusted(length) / small - 1.0).abs() < 0.01, "{length:e}: {} {small}", trusted(length));
        let now = forces(length);
        let bound = 2.0 * f64::EPSILON / length;
        assert!(apart(&now.0, &massless) < bound, "{length:e}");
        assert!((largest(&now.1) * length / heavy - 1.0).abs() < 0.05 + 100.0 * length, "{length:e}");
        // A step of what is trusted is found, one of the length of the leg is refused.
        let machine = with_short_leg(length);
        let start = KinematicState::new(&machine, machine.home_pose());
        for (share, outcome) in [(0.5, Outcome::Solved), (1.0 / small, Outcome::LeftTrustedRegion)] {
            let mut there = machine.home_pose();
            there.position.x += share * trusted(length) * length * machine.joints.radius_m;
            let mut kinematic_state = start;
            let report = refine(&machine, &mut kinematic_state, &leg_lengths(&machine, &there));
            assert_eq!(report.outcome, outcome, "{length:e} {share}");
        }
    }
}

/// Legs that are parallel but for an angle: two shifts and a turn are held by that angle alone.
fn nearly_parallel(angle: f64) -> Machine {
    let mut machine = deployed("motion_base").machine;
    let mut legs = Legs::of(&machine);
    for (k, (a, b)) in legs.base.iter_mut().zip(&legs.platform).enumerate() {
        let turned = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 1.9 * k as f64);
        *a = *b - turned * Vector3::x() * (1.25 * angle);
    }
    machine.joints = legs.joints(&machine.home);
    machine
}

#[test]
fn the_condition_of_nearly_parallel_legs_is_the_inverse_of_their_angle() {
    let condition = |angle: f64| {
        let machine = nearly_parallel(angle);
        KinematicState::new(&machine, machine.home_pose()).sensitivity().condition * angle
    };
    let small = condition(1e-4);
    for power in 2..=7 {
        let angle = 10_f64.powi(-power);
        let ratio = condition(angle) / small;
        assert!((ratio - 1.0).abs() < 0.02, "{angle:e}: {ratio}");
        let machine = nearly_parallel(angle);
        let mut kinematic_state = KinematicState::new(&machine, machine.home_pose());
        let step = 0.5 * kinematic_state.sensitivity().trusted_step * machine.joints.radius_m;
        let mut there = machine.home_pose();
        there.position.z += step;
        let outcome = refine(&machine, &mut kinematic_state, &leg_lengths(&machine, &there)).outcome;
        let expected = if small / angle < MAX_CONDITION { Outcome::Solved } else { Outcome::NearSingular };
        assert_eq!(outcome, expected, "{angle:e}");
    }
}
