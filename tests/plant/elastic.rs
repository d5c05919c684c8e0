//! Elastic legs: energy, play, the rigid limit, and the step that the tolerance asks for.

use super::energy::energy;
use super::*;

const SPRING: ElasticLeg = ElasticLeg { stiffness_n_per_m: 2e7, damping_n_s_m: 0.0, backlash_m: 0.0 };

fn elastic(spring: ElasticLeg) -> Imperfections {
    Imperfections { leg: Some(spring), ..Imperfections::default() }
}

/// A machine without friction.
fn smooth(name: &str) -> Machine {
    let mut machine = machine(name);
    (machine.actuator.viscous_friction_n_s_m, machine.actuator.coulomb_friction_n) = ([0.0; 6], [0.0; 6]);
    machine
}

/// Energy of bodies, drives and springs \[J\].
fn total(machine: &Machine, simulator: &Simulator, spring: &ElasticLeg) -> f64 {
    let drives = simulator.leg_motion();
    let lengths = leg_lengths(machine, &simulator.state().pose);
    let half = 0.5 * spring.backlash_m;
    let mut sum = energy(&without_drives(machine.clone()), simulator.state()).total();
    for (length, (drive, rate)) in lengths.iter().zip(drives.length_m.iter().zip(drives.rate_m_s)) {
        let pressed = drive - length;
        let beyond = pressed - pressed.clamp(-half, half);
        sum += 0.5 * spring.stiffness_n_per_m * beyond * beyond
            + 0.5 * machine.actuator.reflected_mass_kg * rate * rate;
    }
    sum
}

/// Springs that were loaded ring without end: their energy stays, play or not.
#[test]
fn springs_keep_energy() {
    for backlash_m in [0.0, 2e-4] {
        let mut machine = smooth("motion_base");
        machine.gravity_m_s2.fill(0.0);
        let spring = ElasticLeg { backlash_m, ..SPRING };
        let mut simulator = simulator(&machine, &elastic(spring));
        simulator.advance(0.02, Some(&[4000.0, -4000.0, 4000.0, 3000.0, -2000.0, 1000.0]));
        let start = total(&machine, &simulator, &spring);
        let (mut worst, mut swing) = (0.0_f64, 0.0_f64);
        for _ in 0..500 {
            simulator.advance(1e-3, Some(&[0.0; LEGS]));
            worst = worst.max((total(&machine, &simulator, &spring) / start - 1.0).abs());
            let drives = Vector6::from(simulator.leg_motion().length_m);
            swing =
                swing.max((drives - Vector6::from(leg_lengths(&machine, &simulator.state().pose))).amax());
        }
        // Contact that comes and goes within a step costs order.
        assert!(worst < if backlash_m == 0.0 { 1e-6 } else { 1e-3 }, "{worst}");
        assert!(swing > 2e-5, "it rings: {swing}");
        assert_eq!(simulator.brakes(), Brakes::Open);
    }
}

#[test]
fn damping_takes_the_ringing_away() {
    let mut machine = smooth("motion_base");
    machine.gravity_m_s2.fill(0.0);
    let ringing = |damping_n_s_m| {
        let spring = ElasticLeg { damping_n_s_m, ..SPRING };
        let mut simulator = simulator(&machine, &elastic(spring));
        simulator.advance(0.02, Some(&[4000.0, -4000.0, 4000.0, 3000.0, -2000.0, 1000.0]));
        simulator.advance(0.5, Some(&[0.0; LEGS]));
        let legs = leg_lengths(&machine, &simulator.state().pose);
        (Vector6::from(simulator.leg_motion().length_m) - Vector6::from(legs)).amax()
    };
    let (with, without) = (ringing(2e4), ringing(0.0));
    assert!(without > 1e-5 && with < 1e-2 * without, "{with} {without}");
}

/// At rest under the weight each drive is pressed in by force / stiffness, and stays: opening the brakes moves nothing.
#[test]
fn a_loaded_leg_is_deflected_and_at_rest() {
    let machine = smooth("motion_base");
    for backlash_m in [0.0, 1e-4] {
        let spring = ElasticLeg { backlash_m, ..SPRING };
        let mut simulator = simulator(&machine, &elastic(spring));
        let legs = leg_lengths(&machine, &simulator.state().pose);
        let hold = holding(&machine, &simulator.state().pose);
        for i in 0..LEGS {
            let deflection = simulator.leg_motion().length_m[i] - legs[i];
            let expected = hold[i] / spring.stiffness_n_per_m + 0.5 * backlash_m * hold[i].signum();
            assert!((deflection - expected).abs() < 1e-12 && deflection > 1e-5, "{deflection} {expected}");
        }
        simulator.advance(0.2, Some(&hold));
        let fastest = largest(&simulator.leg_motion().rate_m_s);
        assert!(fastest < 1e-9, "{fastest}");
    }
}

/// In the play nothing is transmitted: the drive moves, the platform does not.
#[test]
fn play_separates_drive_and_platform() {
    let mut machine = smooth("motion_base");
    machine.gravity_m_s2.fill(0.0);
    let spring = ElasticLeg { backlash_m: 1e-3, ..SPRING };
    let mut simulator = simulator(&machine, &elastic(spring));
    let start = *simulator.state();
    let length = simulator.leg_motion().length_m;
    // 100 N move 400 kg by 0.4 mm in 56 ms, within half of the play.
    for _ in 0..56 {
        simulator.advance(1e-3, Some(&[100.0; LEGS]));
        assert_eq!(simulator.state().pose.position, start.pose.position);
    }
    let way = simulator.leg_motion().length_m[0] - length[0];
    let expected = 0.5 * 100.0 / machine.actuator.reflected_mass_kg * 0.056 * 0.056;
    assert!((way / expected - 1.0).abs() < 1e-9, "{way} {expected}");
    simulator.advance(0.02, Some(&[100.0; LEGS]));
    assert!((simulator.state().pose.position - start.pose.position).norm() > 1e-6, "then it hits the flank");
}

/// Softness is a small thing on a stiff machine: what it changes falls with 1 / stiffness. Friction of either
/// section is on the drive then, and takes as much.
#[test]
fn a_stiff_leg_is_nearly_rigid() {
    let mut machine = machine("motion_base");
    machine.actuator.coulomb_friction_n = [100.0; 6];
    let friction = Friction { viscous_n_s_m: 700.0, coulomb_n: 50.0, ..Friction::default() };
    let run = |leg| {
        let wanted = Imperfections { friction, leg, ..Imperfections::default() };
        let mut simulator = simulator(&machine, &wanted);
        for k in 0..400 {
            // Open loop: all get the same forces.
            let state = home(&machine);
            let ramp = (f64::from(k) / 200.0).min(1.0);
            let force = shaking(&machine, &state, 1e-3 * f64::from(k), 0.02 * ramp, 1.0);
            simulator.advance(1e-3, Some(&force));
        }
        simulator.state().pose
    };
    let rigid = run(None);
    let [softer, stiffer] = [1e8, 4e8].map(|stiffness_n_per_m| {
        let spring = ElasticLeg { stiffness_n_per_m, damping_n_s_m: 1e5, ..SPRING };
        run(Some(spring)).displacement_to(&rigid).linear.norm()
    });
    let way = home(&machine).pose.displacement_to(&rigid).linear.norm();
    assert!((2.5..6.0).contains(&(softer / stiffer)) && softer < 2e-3 * way, "{softer} {stiffer} {way}");
}

/// The step that is chosen keeps positions within the tolerance of a step eight times as short; steps that a loose
/// tolerance allows do not.
#[test]
fn the_step_keeps_the_tolerance() {
    let machine = smooth("motion_base");
    let spring = |stiffness_n_per_m, damping_n_s_m| {
        elastic(ElasticLeg { stiffness_n_per_m, damping_n_s_m, backlash_m: 0.0 })
    };
    let lag = |hertz| {
        let mut wanted = Imperfections::default();
        wanted.drive.bandwidth_hz = Some(hertz);
        wanted
    };
    let mut beyond = 0;
    for (what, wanted) in [
        ("spring of 2e7 N/m", spring(2e7, 0.0)),
        ("spring of 3e8 N/m", spring(3e8, 0.0)),
        ("spring of 3e9 N/m", spring(3e9, 0.0)),
        ("lag of 400 Hz", lag(400.0)),
        ("lag of 1 kHz", lag(1000.0)),
        ("lag of 1 kHz behind a spring", Imperfections { leg: spring(3e8, 0.0).leg, ..lag(1000.0) }),
    ] {
        let run = |longest: f64, tolerance: f64| {
            let mut simulator = Simulator::imperfect(&machine, DECELERATION, longest, tolerance, &wanted);
            let hold = holding(&machine, &home(&machine).pose);
            let cycle = |k| {
                let sign = if k / 10 % 2 == 0 { 1.0 } else { -1.0 };
                simulator.advance(1e-3, Some(&hold.map(|force| force + 1000.0 * sign)));
                Vector6::from(simulator.leg_motion().length_m)
            };
            let lengths: Vec<_> = (0..100).map(cycle).collect();
            (simulator.terms().step_s, lengths)
        };
        let apart = |a: &[Vector6<f64>], b: &[Vector6<f64>]| {
            a.iter().zip(b).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max)
        };
        let (step, chosen) = run(1e-3, TOLERANCE_M);
        let (_, exact) = run(step / 8.0, TOLERANCE_M);
        let (loose_step, loose) = run(1e-3, 1e-5);
        let [error, loose] = [&chosen, &loose].map(|lengths| apart(lengths, &exact));
        assert!(step < 1e-3 && error < TOLERANCE_M, "{what}: {error}");
        assert!(loose_step > step && loose > 2.0 * error, "{what}: {loose}");
        beyond += usize::from(loose > TOLERANCE_M);
    }
    assert!(beyond >= 2, "the tolerance is not kept by itself");
}

#[test]
fn what_cannot_be_seen_is_left_out() {
    let machine = machine("motion_base");
    let terms = |stiffness_n_per_m, backlash_m, hertz| {
        let mut wanted = elastic(ElasticLeg { stiffness_n_per_m, backlash_m, damping_n_s_m: 0.0 });
        wanted.drive.bandwidth_hz = Some(hertz);
        let terms = *simulator(&machine, &wanted).terms();
        (terms.elastic.is_some(), terms.lag_per_s.is_some(), terms.step_s < DEFAULT_STEP_S)
    };
    // 20 kN deflect 1e12 N/m by 0.02 um.
    assert_eq!(terms(1e12, 0.0, 1e5), (false, false, false));
    assert!(terms(1e12, 1e-6, 1e5).0);
    assert_eq!(terms(3e9, 0.0, 1e5), (true, false, true));
    assert_eq!(terms(1e12, 0.0, 1000.0), (false, true, true));
    // A drive without mass has no motion of its own.
    let massless = hexad_support::machine("fried2008");
    assert_eq!(massless.actuator.reflected_mass_kg, 0.0);
    let simulator = simulator(&massless, &elastic(SPRING));
    assert!(simulator.terms().elastic.is_none());
    assert_eq!(Legs::of(simulator.machine()).base, Legs::of(&massless).base);
}

/// The deflection is still there when a brake that closed in motion opens again.
#[test]
fn a_brake_holds_drive_and_rod_alike() {
    let machine = smooth("motion_base");
    let mut simulator = simulator(&machine, &elastic(SPRING));
    let deflection = |simulator: &Simulator| {
        let legs = leg_lengths(&machine, &simulator.state().pose);
        Vector6::from(simulator.leg_motion().length_m) - Vector6::from(legs)
    };
    for k in 0..300 {
        let force = shaking(&machine, simulator.state(), 1e-3 * f64::from(k), 0.1, 1.0);
        simulator.advance(1e-3, Some(&force));
    }
    let before = deflection(&simulator);
    simulator.advance(1.0, None);
    assert_eq!(simulator.brakes(), Brakes::Closed);
    assert!((deflection(&simulator) - before).amax() < 1e-12 && before.amax() > 1e-5);
    assert_eq!(simulator.leg_motion().rate_m_s, [0.0; LEGS]);
}
