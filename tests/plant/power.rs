//! Power balance: the work of the actuators is the change of energy, over a whole motion.

use super::energy::{Energy, energy};
use super::*;

/// What a motion did.
#[derive(Debug, Default)]
struct Account {
    /// Largest difference between work done and energy gained, at any time.
    gap: f64,
    /// The same if the spin of the legs had no energy.
    gap_without_spin: f64,
    /// Sum of all work, whatever its sign.
    turnover: f64,
    kinetic_peak: f64,
    spin_peak: f64,
}

/// Shakes a machine for two seconds with forces that are constant over each step, so that their work is
/// exactly force times change of length.
fn account(machine: &Machine, step: f64, size: f64, hertz: f64) -> Account {
    let dynamics = ForwardDynamics::new(machine);
    let mut state = home(machine);
    let start = energy(machine, &state);
    let (mut work, mut result) = (0.0, Account::default());
    let (mut lengths, _) = legs(machine, &state);
    for k in 0..(2.0 / step) as u32 {
        let force = shaking(machine, &state, step * f64::from(k), size, hertz);
        state = integrate(&dynamics, &state, &force, step).unwrap();
        let (after, _) = legs(machine, &state);
        for i in 0..6 {
            work += force[i] * (after[i] - lengths[i]);
            result.turnover += (force[i] * (after[i] - lengths[i])).abs();
        }
        lengths = after;
        let now: Energy = energy(machine, &state);
        let gap = now.total() - start.total() - work;
        result.gap = result.gap.max(gap.abs());
        result.gap_without_spin = result.gap_without_spin.max((gap - now.spin).abs());
        result.kinetic_peak = result.kinetic_peak.max(now.kinetic);
        result.spin_peak = result.spin_peak.max(now.spin);
    }
    result
}

/// Legs that spin: fat, and 0.3 rad from the first axes of their universal joints.
fn fat_legs(mut machine: Machine) -> Machine {
    for link in [&mut machine.cylinder, &mut machine.rod] {
        link.axial_inertia_kg_m2 = 1.5 * link.transverse_inertia.constant_kg_m2;
    }
    let pose = home(&machine).pose;
    let directions = leg_directions(&machine, &pose);
    let axes = directions.map(|n| {
        let across = n.cross(&machine.gravity_m_s2).normalize();
        n * 0.3f64.cos() + across * 0.3f64.sin()
    });
    machine.joints = Legs { universal_axis: axes, ..Legs::of(&machine) }.joints(&machine.home);
    machine
}

/// Reflected mass is energy as well; only friction loses any. The spin of fat legs is seen.
#[test]
fn work_becomes_energy() {
    let ideal = |name| without_drives(machine(name));
    let mut driven = machine("motion_base");
    (driven.actuator.viscous_friction_n_s_m, driven.actuator.coulomb_friction_n) = ([0.0; 6], [0.0; 6]);
    assert!(driven.actuator.reflected_mass_kg > 0.0);
    for (name, machine, size, hertz) in [
        ("motion_base", ideal("motion_base"), 0.1, 1.0),
        ("tsai2000", ideal("tsai2000"), 0.1, 1.0),
        ("scattered", ideal("scattered"), 0.1, 1.0),
        ("tilted", ideal("tilted"), 0.1, 1.5),
        ("tabletop", ideal("tabletop"), 0.03, 3.0),
        ("motion_base with drives", driven, 0.1, 1.0),
        ("motion_base with fat legs", fat_legs(ideal("motion_base")), 0.1, 1.0),
        ("scattered with fat legs", fat_legs(ideal("scattered")), 0.1, 1.0),
    ] {
        assert_eq!(machine.rod.transverse_inertia.quadratic_kg, 0.0, "{name}: a rod that is rigid");
        let account = account(&machine, DEFAULT_STEP_S, size, hertz);
        let share = account.gap / account.turnover;
        assert!(share < 1e-13 && account.gap < 1e-11 * account.kinetic_peak, "{name}: {account:?}");
        assert!(account.kinetic_peak > 1e-4 * account.turnover, "{name} moved: {account:?}");
        if name.ends_with("fat legs") {
            assert!(account.spin_peak > 0.01 * account.kinetic_peak, "{account:?}");
            assert!(account.gap_without_spin > 1e6 * account.gap, "the balance sees it: {account:?}");
        }
    }
}
