//! Brakes and end stops.

use super::*;

/// A platform in the middle of a motion.
fn in_motion(machine: &Machine) -> Simulator {
    let mut simulator = Simulator::new(machine, DECELERATION, DEFAULT_STEP_S);
    for k in 0..300 {
        let force = shaking(machine, simulator.state(), 1e-3 * f64::from(k), 0.1, 1.0);
        simulator.advance(1e-3, Some(&force));
    }
    assert_eq!(simulator.brakes(), Brakes::Open);
    simulator
}

/// Forces that hold the platform where it is.
fn holding(simulator: &Simulator) -> [f64; LEGS] {
    super::holding(simulator.machine(), &simulator.state().pose)
}

#[test]
fn a_platform_begins_at_rest_with_brakes_closed() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let mut simulator = Simulator::new(&machine(name), DECELERATION, DEFAULT_STEP_S);
        let start = *simulator.state();
        assert_eq!((simulator.brakes(), start.twist), (Brakes::Closed, Twist::default()));
        simulator.advance(1.0, None);
        assert_eq!((simulator.brakes(), *simulator.state()), (Brakes::Closed, start), "whatever its weight");
    }
}

#[test]
fn without_force_all_legs_stop_in_a_straight_line_at_the_same_time() {
    for name in ["fried2008", "motion_base", "tsai2000", "scattered"] {
        let mut simulator = in_motion(&machine(name));
        let begin = simulator.leg_motion();
        let fastest = largest(&begin.rate_m_s);
        let duration = fastest / DECELERATION;
        assert!(fastest > 0.05, "{name}: {fastest}");
        let (dt, mut t) = (0.05 * duration, 0.0);
        let mut before = begin.rate_m_s;
        while !matches!(simulator.brakes(), Brakes::Closed) {
            simulator.advance(dt, None);
            t += dt;
            let rates = simulator.leg_motion().rate_m_s;
            let share = (1.0 - t / duration).max(0.0);
            for i in 0..LEGS {
                assert!(
                    (rates[i] - share * begin.rate_m_s[i]).abs() < 1e-9 * fastest,
                    "{name} leg {i} at {t}"
                );
                assert!(rates[i] * begin.rate_m_s[i] >= -1e-12, "{name}: leg {i} turned back");
                assert!(rates[i].abs() <= before[i].abs() + 1e-12, "{name}: leg {i} sped up");
            }
            before = rates;
        }
        assert!(t <= 1.06 * duration, "{name}: {t} of {duration}");
        for i in 0..LEGS {
            let way = simulator.leg_motion().length_m[i] - begin.length_m[i];
            let expected = 0.5 * begin.rate_m_s[i] * duration;
            assert!((way - expected).abs() < 1e-4 * fastest * duration, "{name} leg {i}: {way} {expected}");
        }
        let end = *simulator.state();
        assert_eq!(end.twist, Twist::default(), "exactly at rest");
        simulator.advance(3.0, None);
        assert_eq!((*simulator.state(), simulator.brakes()), (end, Brakes::Closed), "{name} stands");
    }
}

#[test]
fn brakes_act_at_once_and_however_time_is_cut() {
    let start = in_motion(&machine("fried2008"));
    let [mut fine, mut coarse] = [start.clone(), start];
    for _ in 0..500 {
        fine.advance(1e-3, None);
    }
    coarse.advance(0.5, None);
    assert_eq!((fine.brakes(), coarse.brakes()), (Brakes::Closed, Brakes::Closed));
    let apart = fine.state().pose.displacement_to(&coarse.state().pose).vector();
    assert!(apart.norm() < 1e-6, "{apart}");
}

#[test]
fn a_force_opens_the_brakes_again() {
    let machine = machine("motion_base");
    let mut simulator = in_motion(&machine);
    simulator.advance(1e-3, None);
    assert!(matches!(simulator.brakes(), Brakes::Closing { .. }));
    let force = holding(&simulator);
    simulator.advance(1e-3, Some(&force));
    assert_eq!(simulator.brakes(), Brakes::Open, "while they were closing");
    simulator.advance(1.0, None);
    assert_eq!(simulator.brakes(), Brakes::Closed);
    let at = *simulator.state();
    let push = holding(&simulator).map(|force| force + 100.0);
    simulator.advance(0.1, Some(&push));
    assert_eq!(simulator.brakes(), Brakes::Open, "when they were closed");
    assert!(simulator.state().pose.position.z > at.pose.position.z + 1e-4);
    // Force and no force are told apart by presence, not by size.
    simulator.advance(1e-3, Some(&[0.0; LEGS]));
    assert_eq!(simulator.brakes(), Brakes::Open);
}

#[test]
fn no_time_changes_nothing() {
    let mut simulator = in_motion(&machine("fried2008"));
    let (state, brakes) = (*simulator.state(), simulator.brakes());
    for duration in [0.0, -1.0, f64::NAN] {
        simulator.advance(duration, None);
        assert_eq!((*simulator.state(), simulator.brakes()), (state, brakes));
    }
}

#[test]
fn an_end_stop_closes_the_brakes_for_good() {
    for (name, sign) in [("fried2008", 1.0), ("motion_base", 1.0), ("motion_base", -1.0), ("tsai2000", 1.0)] {
        let machine = machine(name);
        let mut simulator = Simulator::new(&machine, DECELERATION, DEFAULT_STEP_S);
        let push = [sign * 0.5 * machine.actuator.max_force_n; LEGS];
        simulator.advance(5.0, Some(&push));
        let Brakes::EndStop { leg } = simulator.brakes() else { panic!("{name}: {:?}", simulator.brakes()) };
        let length = simulator.leg_motion().length_m[leg];
        let (min, max) = (machine.actuator.min_length_m, machine.actuator.max_length_m);
        assert!(!(min..=max).contains(&length), "{name}: leg {leg} is {length}");
        // It stops within the step that took it there; nothing here gets faster than 30 m/s.
        let beyond = (min - length).max(length - max);
        assert!(beyond < 30.0 * DEFAULT_STEP_S, "{name}: {beyond} m beyond");
        let at = *simulator.state();
        assert_eq!(at.twist, Twist::default());
        for force in [Some(&push.map(|force| -force)), None, Some(&[0.0; LEGS])] {
            simulator.advance(0.5, force);
            assert_eq!((*simulator.state(), simulator.brakes()), (at, Brakes::EndStop { leg }), "{name}");
        }
    }
}
