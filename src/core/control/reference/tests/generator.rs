//! Tests of the generator as a whole: its motion in one step, and where it leads.

use crate::control::reference::tests::*;

pub(super) fn constants(change: impl FnOnce(&mut Machine, &mut Parameters)) -> Constants {
    let mut machine = machine(&mut RandomVectors::new(61));
    let mut parameters = parameters(&machine);
    change(&mut machine, &mut parameters);
    Constants::new(&machine, parameters)
}

/// Setpoint at rest at an offset from home, with the time stamp 0.
pub(super) fn standing(constants: &Constants, offset: [f64; 6]) -> SetpointMotion {
    let home = constants.machine().home;
    let x = core::array::from_fn::<f64, 6, _>(|axis| home[axis] + offset[axis]);
    SetpointMotion::new(Setpoint::motion(0, TaskState::at_rest(x)))
}

pub(super) fn started(constants: &Constants, motion: &Motion) -> ReferenceGenerator {
    let mut reference = ReferenceGenerator::new(constants);
    reference.verify_start(constants, motion).ok();
    reference.begin_placed_motion(0);
    reference
}

/// Moves in steps of 1 ms towards a target. Returns the largest speeds of translation and rotation.
pub(super) fn run(
    constants: &Constants,
    reference: &mut ReferenceGenerator,
    target: &Target<'_>,
    steps: u64,
) -> [f64; 2] {
    let mut speeds = [0.0_f64; 2];
    for _ in 0..steps {
        reference.advance(constants, reference.time_ns() + MS, Some(target));
        let twist = reference.motion().twist;
        speeds = [speeds[0].max(twist.linear.norm()), speeds[1].max(twist.angular.norm())];
    }
    speeds
}

pub(super) fn x(constants: &Constants, reference: &ReferenceGenerator) -> [f64; 6] {
    task_coordinates(&reference.motion().pose, &constants.machine().home)
}

/// A cycle consists of steps of 1 ms, and of at most 32 steps.
#[test]
fn a_long_cycle_moves_as_several_short_ones() {
    let constants = constants(|_, _| ());
    let setpoint = standing(&constants, [0.1, -0.1, 0.05, 0.1, 0.1, -0.1]);
    let target = Target::Motion(&setpoint);
    // Steps of a given length, one at a time.
    let after_steps = |step_ns: u64, count: u64| {
        let mut reference = started(&constants, &at_rest(constants.home.pose()));
        for k in 1..=count {
            reference.step(&constants, k * step_ns, Some(&target));
        }
        *reference.motion()
    };
    let after = |cycle_ns: u64, count: u64| {
        let mut reference = started(&constants, &at_rest(constants.home.pose()));
        for k in 1..=count {
            reference.advance(&constants, k * cycle_ns, Some(&target));
        }
        *reference.motion()
    };
    assert_eq!(after(10 * MS, 12), after(MS, 120));
    assert_eq!(after(3 * MS / 2, 64), after(3 * MS / 4, 128));
    assert_eq!(after(32 * MS, 4), after(MS, 128));
    assert_eq!(after(128 * MS, 1), after_steps(4 * MS, 32));
    assert_ne!(after(MS, 120), after(MS / 2, 240));
    let mut reference = started(&constants, &at_rest(constants.home.pose()));
    reference.advance(&constants, MS, Some(&target));
    let before = reference.clone();
    reference.advance(&constants, MS, Some(&target));
    assert_eq!((reference.motion(), reference.time_ns()), (before.motion(), MS));
    assert_eq!(reference.motion_for_held_force(MS), before.motion_for_held_force(MS));
}

/// The largest rate of a leg is 97 % of its limit during a long motion.
#[test]
fn the_reference_cruises_at_the_limit_of_leg_rates() {
    let constants = constants(|machine, _| machine.actuator.max_rate_m_s = 0.4);
    let setpoint = standing(&constants, [0.0, 0.0, 0.0, 0.0, 0.0, 0.6]);
    let mut reference = started(&constants, &at_rest(constants.home.pose()));
    let (mut fastest, mut cruising) = (0.0_f64, 0);
    for _ in 0..2000 {
        run(&constants, &mut reference, &Target::Motion(&setpoint), 1);
        let Motion { pose, twist, .. } = reference.motion();
        let (_, rates) = leg_lengths_and_rates(constants.machine(), pose, twist);
        let rate = rates.iter().fold(0.0_f64, |fastest, rate| fastest.max(rate.abs()));
        fastest = fastest.max(rate);
        if (rate / 0.4 - 0.97).abs() < 0.003 {
            assert!(reference.active_limits().contains(Limit::LegRate));
            cruising += 1;
        }
    }
    let left = (setpoint.motion.pose.position - reference.motion().pose.position).norm();
    assert!((0.965..0.985).contains(&(fastest / 0.4)) && cruising > 800, "{fastest} {cruising}");
    assert!(left < 1e-6, "{left}");
}

/// A start discards the earlier reference.
#[test]
fn a_start_clears_the_history() {
    let constants = constants(|_, _| ());
    let aside = standing(&constants, [0.0, 0.0, 0.0, 0.1, 0.0, 0.0]);
    let mut reference = started(&constants, &at_rest(constants.home.pose()));
    run(&constants, &mut reference, &Target::Motion(&aside), 50);
    reference.verify_start(&constants, &aside.motion).ok();
    reference.begin_placed_motion(50 * MS);
    assert_eq!(reference.motion_at(50 * MS), aside.motion);
    assert_eq!(reference.motion_at(49 * MS).pose, aside.motion.pose);
}

/// A pose is approached with 0.3 of the limits, a setpoint with the closing scale.
#[test]
fn the_way_to_a_target_takes_its_share_of_the_limits() {
    let constants = constants(|_, _| ());
    let there = standing(&constants, [0.35, 0.0, 0.0, 0.0, 0.0, 0.35]);
    let cruise = |target: &Target<'_>, scale: f64| {
        let mut reference = started(&constants, &at_rest(constants.home.pose()));
        reference.set_closing_scale(scale);
        let [shift, turn] = run(&constants, &mut reference, target, 4000);
        assert!((reference.motion().pose.position - there.motion.pose.position).norm() < 1e-6);
        [shift / LIMITS.position.velocity, turn / LIMITS.orientation.velocity]
    };
    let scaled = Target::Motion(&there);
    let pose = Target::Pose { pose: &there.motion.pose, speed_share: 1.0 };
    for (found, share) in [
        (cruise(&scaled, 0.3), 0.3),
        (cruise(&pose, 1.0), 0.3 * 0.999),
        (cruise(&pose, 0.3), 0.3 * 0.999),
        (cruise(&scaled, 0.2), 0.2),
    ] {
        assert!(found.iter().all(|found| (found / share - 1.0).abs() < 5e-3), "{found:?}, not {share}");
    }
}

#[test]
fn each_kind_of_setpoint_has_its_target() {
    let constants = constants(|_, _| ());
    let samples = PoseSamples::default();
    let mut setpoint = standing(&constants, [0.0; 6]);
    for kind in SetpointKind::ALL {
        setpoint.setpoint.kind = kind;
        let target = Target::of_setpoint(&setpoint, &samples);
        assert_eq!(matches!(target, Target::Motion(_)), kind == SetpointKind::Motion);
        assert_eq!(matches!(target, Target::Samples(_)), kind == SetpointKind::Pose);
        assert_eq!(matches!(target, Target::Pose { .. }), kind == SetpointKind::Target);
    }
}

/// Setpoints of a sine, new or 3 ms old, in an angle and in a position. The errors are 3 um and 20 um.
#[test]
fn old_setpoints_of_a_sine_are_followed_as_their_extrapolation() {
    let constants = constants(|_, _| ());
    let w = core::f64::consts::TAU;
    let at = |t: f64| {
        let mut task = TaskState::at_rest(constants.machine().home);
        for (axis, size) in [(1, 0.1), (3, 0.1)] {
            task.x[axis] += size * ((w * t).cos() - 1.0);
            task.xd[axis] = -size * w * (w * t).sin();
            task.xdd[axis] = -size * w * w * (w * t).cos();
        }
        task
    };
    for (age, bounds) in [(0, [6e-6, 3e-5]), (3, [4e-5, 2e-4])] {
        let mut reference = started(&constants, &at(0.0).motion());
        let mut largest = [0.0_f64; 4];
        for k in 0..3000_u64 {
            let sent = k.saturating_sub(age);
            let setpoint = SetpointMotion::new(Setpoint::motion(sent * MS, at(sent as f64 * 1e-3)));
            reference.advance(&constants, (k + 1) * MS, Some(&Target::Motion(&setpoint)));
            if k > 1000 {
                let desired = at((k + 1) as f64 * 1e-3).motion();
                let motion = reference.motion();
                let errors = [
                    (motion.pose.position - desired.pose.position).norm(),
                    (motion.pose.rotation - desired.pose.rotation).norm(),
                    (motion.twist.linear - desired.twist.linear).norm(),
                    (motion.twist.angular - desired.twist.angular).norm(),
                ];
                largest = core::array::from_fn(|kind| largest[kind].max(errors[kind]));
            }
        }
        assert!(largest[..2].iter().all(|error| *error < bounds[0]), "{largest:?}");
        assert!(largest[2..].iter().all(|error| *error < bounds[1]), "{largest:?}");
    }
}

/// The extrapolation ends a timeout and a period before and after the setpoint's instant.
#[test]
fn a_setpoint_is_extrapolated_no_further_than_its_timeout() {
    let constants = constants(|_, _| ());
    let mut setpoint = standing(&constants, [0.0; 6]);
    setpoint.setpoint.time_ns = 1000 * MS;
    for (dt_ms, expected) in [(0, 0.0), (20, 0.02), (-20, -0.02), (500, 0.021), (-500, -0.021)] {
        let instant_ns = (1000 * MS).wrapping_add_signed(dt_ms * 1_000_000);
        let found = setpoint.bounded_extrapolation_s(&constants.parameters, instant_ns);
        assert!((found - expected).abs() < 1e-12, "{dt_ms}: {found}");
    }
}

/// Lasts 50 steps. Another refusal begins the count again. A cycle without a target, as before the drives are
/// ready, is no refusal.
#[test]
fn rotation_and_translation_change_in_proportion_after_a_refusal() {
    let constants = constants(|_, _| {});
    let rest = at_rest(constants.home.pose());
    let aside = standing(&constants, [0.01, 0.0, 0.0, 0.01, 0.0, 0.0]);
    let mut fast = rest;
    fast.twist.linear = Vector3::new(2.0 * LIMITS.position.velocity, 0.0, 0.0);
    let mut reference = started(&constants, &rest);
    reference.advance(&constants, MS, None);
    let steps: Vec<u32> = (0..60)
        .map(|k| {
            reference.motion = if [2, 5].contains(&k) { fast } else { rest };
            run(&constants, &mut reference, &Target::Motion(&aside), 1);
            reference.proportional_steps_left
        })
        .collect();
    assert_eq!(steps[..8], [0, 0, 50, 49, 48, 50, 49, 48]);
    assert_eq!(steps[54..57], [1, 0, 0]);
}

/// The limits that restricted the reference in a cycle, in rotation or in translation.
#[test]
fn the_limits_that_hold_the_reference_back_are_reported() {
    let constants = constants(|_, _| ());
    for offset in [[0.5, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5, 0.0, 0.0]] {
        let setpoint = standing(&constants, offset);
        let mut reference = started(&constants, &at_rest(constants.home.pose()));
        let mut first = [None; 3];
        for k in 0..3000 {
            run(&constants, &mut reference, &Target::Motion(&setpoint), 1);
            for (first, limit) in first.iter_mut().zip([Limit::Jerk, Limit::Acceleration, Limit::Velocity]) {
                if first.is_none() && reference.active_limits().contains(limit) {
                    *first = Some(k);
                }
            }
        }
        // The jerk is limited at once. The acceleration builds up in A / J = 40 ms.
        let [jerk, acceleration, velocity] = first;
        assert_eq!(jerk, Some(0), "{offset:?}");
        assert!(acceleration.is_some() && velocity.is_some(), "{offset:?} {first:?}");
        assert!(reference.active_limits().is_empty() && !reference.is_at_rest());
    }
}
