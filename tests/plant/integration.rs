//! The integrator: order four, and an error at the default step that nobody will ever measure.

use super::*;

/// The states after each `hold` of a motion whose forces are constant that long, with steps of `hold / steps`.
fn motion(machine: &Machine, hold: f64, steps: u32, duration: f64) -> Vec<BodyState> {
    let dynamics = ForwardDynamics::new(machine);
    let mut state = home(machine);
    let holds = (duration / hold).round() as u32;
    let after_hold = |k| {
        let force = shaking(machine, &state, hold * f64::from(k), 0.1, 1.0);
        for _ in 0..steps {
            state = integrate(&dynamics, &state, &force, hold / f64::from(steps)).unwrap();
        }
        state
    };
    (0..holds).map(after_hold).collect()
}

/// Metres plus radians plus their rates.
fn distance(a: &BodyState, b: &BodyState) -> f64 {
    (a.pose.position - b.pose.position).norm()
        + angle_between(&a.pose.rotation, &b.pose.rotation)
        + (a.twist.vector() - b.twist.vector()).norm()
}

#[test]
fn halving_the_step_divides_the_error_by_sixteen() {
    for name in ["fried2008", "motion_base", "scattered", "tsai2000"] {
        let mut machine = machine(name);
        // The kink of dry friction has no fourth derivative.
        machine.actuator.coulomb_friction_n = [0.0; 6];
        let ends = [1, 2, 4, 8, 64].map(|steps| *motion(&machine, 0.016, steps, 0.8).last().unwrap());
        let errors: Vec<_> = ends[..4].iter().map(|end| distance(end, &ends[4])).collect();
        let ratios: Vec<_> = errors.iter().zip(&errors[1..]).map(|(a, b)| a / b).collect();
        assert!(errors[3] > 1e-12, "{name}: above rounding");
        assert!(ratios.iter().all(|ratio| (11.0..23.0).contains(ratio)), "{name}: {ratios:?}");
    }
}

/// A velocity that turns its axis: dynamics have no part in this error, only the order of the rotation has.
#[test]
fn an_attitude_whose_axis_turns_has_order_four() {
    let acceleration = |state: &PlantState, _: f64| {
        let angular = Vector3::z().cross(&state.platform.twist.angular);
        let platform = Acceleration { angular, linear: Vector3::zeros() };
        Some(Accelerations { platform, drives_m_s2: Vector6::zeros() })
    };
    let mut start = home(&machine("fried2008"));
    start.twist.angular = Vector3::x() * 10.0;
    let [coarse, fine, exact] = [16_u32, 32, 512].map(|steps| {
        let mut state = PlantState { platform: start, drives: DriveStates::default() };
        for _ in 0..steps {
            state =
                hexad::plant::integrator::integrate(&state, 1.0 / f64::from(steps), acceleration).unwrap();
        }
        state.platform
    });
    let ratio = distance(&coarse, &exact) / distance(&fine, &exact);
    assert!((14.0..18.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_default_step_is_exact_beside_a_micrometre() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let machine = machine(name);
        let [found, exact] = [4, 32].map(|steps| motion(&machine, 4.0 * DEFAULT_STEP_S, steps, 5.0));
        let [mut position, mut orientation] = [Errors::default(); 2];
        for (a, b) in found.iter().zip(&exact) {
            position.add((a.pose.position - b.pose.position).norm());
            orientation.add(angle_between(&a.pose.rotation, &b.pose.rotation));
        }
        position.assert_within(1e-12, &format!("{name} position after 5 s of default steps"));
        orientation.assert_within(1e-12, &format!("{name} orientation after 5 s of default steps"));
        let travel = found.iter().map(|state| (state.pose.position - home(&machine).pose.position).norm());
        assert!(travel.fold(0.0, f64::max) > 0.05 * machine.joints.radius_m, "{name} moved");
    }
}
