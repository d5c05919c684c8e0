//! Dry friction: stable at the default step, and it only ever takes energy.

use super::energy::{energy, worked};
use super::*;

/// A machine in space, pushed along at first, then left to its friction: kinetic energy after every step.
fn coasting(machine: &Machine, seconds: f64) -> Vec<f64> {
    let mut simulator = Simulator::new(machine, DECELERATION, DEFAULT_STEP_S);
    let kinetic = |simulator: &Simulator| energy(machine, simulator.state()).kinetic;
    for k in 0..1600 {
        let t = DEFAULT_STEP_S * f64::from(k);
        let force = shaking(machine, simulator.state(), t, 0.1, 1.0);
        simulator.advance(DEFAULT_STEP_S, Some(&force));
    }
    let mut energies = vec![kinetic(&simulator)];
    for _ in 0..(seconds / DEFAULT_STEP_S) as u32 {
        simulator.advance(DEFAULT_STEP_S, Some(&[0.0; 6]));
        energies.push(kinetic(&simulator));
    }
    assert_eq!(simulator.brakes(), Brakes::Open);
    energies
}

#[test]
fn dry_friction_takes_energy_and_nothing_chatters() {
    for (name, coulomb) in
        [("scattered", 75.0), ("fried2008", 3.0), ("tsai2000", 0.5), ("motion_base", 3000.0)]
    {
        let mut machine = machine(name);
        machine.gravity_m_s2.fill(0.0);
        (machine.actuator.viscous_friction_n_s_m, machine.actuator.coulomb_friction_n) =
            ([0.0; 6], [coulomb; 6]);
        // The energy of a rod whose inertia varies is not conserved to begin with.
        machine.rod.transverse_inertia.quadratic_kg = 0.0;
        let energies = coasting(&machine, 2.0);
        let (first, last) = (energies[0], energies[energies.len() - 1]);
        assert!(energies.is_sorted_by(|a, b| *b <= a + 1e-15 * first), "{name} gained energy");
        assert!(first > 1e-3 && last < 1e-9 * first, "{name}: {first} to {last}");
    }
}

/// Friction that holds a platform against a small force: it creeps at the smoothing speed, no more.
#[test]
fn dry_friction_holds() {
    let mut machine = machine("scattered");
    machine.gravity_m_s2.fill(0.0);
    machine.actuator.viscous_friction_n_s_m = [0.0; 6];
    let mut simulator = Simulator::new(&machine, DECELERATION, DEFAULT_STEP_S);
    let smoothing = simulator.machine().actuator.coulomb_smoothing_m_s;
    let half = 0.5 * machine.actuator.largest_coulomb_friction();
    for _ in 0..1000 {
        simulator.advance(1e-3, Some(&[half, -half, half, half, -half, -half]));
        let fastest = largest(&simulator.leg_motion().rate_m_s);
        assert!(fastest < smoothing, "{fastest} of {smoothing}");
    }
    let BodyState { twist, .. } = *simulator.state();
    assert!(twist.vector().norm() > 0.0);
}

/// Viscous friction alone: the energy of a linear decay, known in closed form for legs that move alike.
#[test]
fn viscous_friction_dissipates_what_it_should() {
    let mut machine = machine("motion_base");
    machine.gravity_m_s2.fill(0.0);
    let mut simulator = Simulator::new(&machine, DECELERATION, DEFAULT_STEP_S);
    simulator.advance(0.2, Some(&[300.0; 6]));
    let c = machine.actuator.largest_viscous_friction();
    let power = |rates: [f64; 6]| -rates.iter().map(|rate| c * rate * rate).sum::<f64>();
    let (start, gained, put_in) = worked(&machine, &mut simulator, 400, &[0.0; 6], power);
    assert!(gained < -0.1 * start && (gained / put_in - 1.0).abs() < 1e-9, "{gained} {put_in}");
}

/// Load friction alone: what the drives put in, less its share, becomes kinetic energy. The commands are not the forces.
#[test]
fn load_friction_takes_its_share_of_the_drives_power() {
    const COMMAND: [f64; 6] = [300.0, -200.0, 100.0, 250.0, -300.0, 150.0];
    const FORCE_SCALE: [f64; 6] = [0.9, 1.1, 1.0, 0.8, 1.2, 1.05];
    const LOAD_FRICTION: [f64; 6] = [0.3, 0.1, 0.0, 0.2, 0.05, 0.25];
    let mut machine = machine("motion_base");
    machine.gravity_m_s2.fill(0.0);
    let actuator = &mut machine.actuator;
    (actuator.viscous_friction_n_s_m, actuator.coulomb_friction_n) = ([0.0; 6], [0.0; 6]);
    (actuator.force_scale, actuator.load_friction_share) = (FORCE_SCALE, LOAD_FRICTION);
    let mut simulator = Simulator::new(&machine, DECELERATION, DEFAULT_STEP_S);
    // Every leg is faster than the smoothing speed from here on.
    simulator.advance(0.05, Some(&COMMAND));
    let power = |rates: [f64; 6]| {
        assert!(rates.iter().all(|rate| rate.abs() > 1e-3), "{rates:?}");
        (0..6)
            .map(|leg| {
                let force = FORCE_SCALE[leg] * COMMAND[leg];
                force * rates[leg] - LOAD_FRICTION[leg] * (force * rates[leg]).abs()
            })
            .sum::<f64>()
    };
    let (start, gained, put_in) = worked(&machine, &mut simulator, 400, &COMMAND, power);
    assert!(gained > start && (gained / put_in - 1.0).abs() < 1e-9, "{gained} {put_in}");
}
