//! Tests of the generator at its bounds: where it may begin, what it refuses, and how it returns.

use crate::control::reference::stop::held_stop::Phase;
use crate::control::reference::tests::generator::{constants, run, standing, started, x};
use crate::control::reference::tests::*;

/// Envelope of half widths around home.
fn around_home(half: [f64; 6]) -> Option<Envelope> {
    let [lowest, highest] = [-1.0, 1.0]
        .map(|sign| core::array::from_fn(|axis| [0.0, 0.0, 0.0, 0.0, 0.0, 1.5][axis] + sign * half[axis]));
    Some(Envelope { lowest, highest })
}

/// A platform is beyond the envelope when control begins. It returns, and does not leave the envelope again.
#[test]
fn bounds_that_were_relaxed_at_the_start_hold_after_the_return() {
    let constants = constants(|_, parameters| {
        parameters.envelope = around_home([0.3, 0.3, 0.3, 0.1, 0.1, 0.1]);
    });
    let beyond = standing(&constants, [0.0, 0.0, 0.0, 0.12, 0.0, 0.0]);
    let home = standing(&constants, [0.0; 6]);
    let mut reference = started(&constants, &at_rest(&beyond.motion.pose));
    assert_eq!(reference.verify_start(&constants, &at_rest(&beyond.motion.pose)), Ok(()));
    run(&constants, &mut reference, &Target::Motion(&beyond), 200);
    assert!((x(&constants, &reference)[3] - 0.12).abs() < 1e-4);
    // The platform returns at some millimetres per second, because the bounds follow it closely.
    run(&constants, &mut reference, &Target::Motion(&home), 10_000);
    assert!(x(&constants, &reference)[3].abs() < 1e-6, "{:?}", x(&constants, &reference));
    run(&constants, &mut reference, &Target::Motion(&beyond), 2000);
    let is_inside = |x: [f64; 6]| (0.09..=0.1 + 2e-9).contains(&x[3]);
    assert!(is_inside(x(&constants, &reference)), "{:?}", x(&constants, &reference));
    // Control begins again within the envelope, before the bounds have followed the platform back.
    let mut reference = started(&constants, &at_rest(&beyond.motion.pose));
    reference.verify_start(&constants, &home.motion).ok();
    reference.begin_placed_motion(0);
    run(&constants, &mut reference, &Target::Motion(&beyond), 2000);
    assert!(is_inside(x(&constants, &reference)), "{:?}", x(&constants, &reference));
}

#[test]
fn a_start_is_refused_with_the_limit_that_no_stop_keeps() {
    let change = |limit: Limit| {
        move |machine: &mut Machine, parameters: &mut Parameters| match limit {
            Limit::Stroke => parameters.stroke_margin_m = 0.82,
            Limit::LegRate => machine.actuator.max_rate_m_s = 0.2,
            Limit::Envelope => parameters.envelope = around_home([0.01; 6]),
            Limit::Velocity => parameters.limits.position.velocity = 0.2,
            _ => parameters.max_condition = 1.0,
        }
    };
    let twist = Twist { angular: Vector3::zeros(), linear: Vector3::new(0.1, 0.1, 0.4) };
    for limit in [Limit::Stroke, Limit::LegRate, Limit::Envelope, Limit::Velocity, Limit::Condition] {
        let constants = constants(change(limit));
        let mut reference = ReferenceGenerator::new(&constants);
        let motion = Motion { twist, ..at_rest(constants.home.pose()) };
        assert_eq!(reference.verify_start(&constants, &motion), Err(limit.into()));
    }
    let constants = constants(|_, _| ());
    let mut reference = ReferenceGenerator::new(&constants);
    let motion = Motion { twist, ..at_rest(constants.home.pose()) };
    assert_eq!(reference.verify_start(&constants, &motion), Ok(()));
}

/// Brakes have carried the platform beyond the margin. At rest control may begin, and the platform returns.
/// In motion control may not begin if the motion would end at the end stop.
#[test]
fn a_start_beside_an_end_stop_never_leads_into_it() {
    let mut samples = RandomVectors::new(31);
    let (mut refused, mut begun) = (0, 0);
    for _ in 0..2000 {
        let free = constants(|_, parameters| parameters.stroke_margin_m = 0.01);
        let mut machine = free.machine().clone();
        let stroke = machine.actuator.stroke();
        let pose = pose(&mut samples, &free);
        // The end stop is up to 4e-4 of the stroke from the longest leg, often nearer.
        let longest = leg_lengths(&machine, &pose).into_iter().fold(0.0, f64::max);
        let gap = 4e-4 * stroke * samples.uniform() * samples.uniform();
        machine.actuator.max_length_m = longest + gap;
        machine.actuator.min_length_m = machine.actuator.max_length_m - stroke;
        let at_end = Constants::new(&machine, free.parameters);
        let speed = 0.03 * samples.uniform() * samples.uniform();
        let twist = Twist { angular: Vector3::zeros(), linear: Vector3::new(0.0, 0.0, speed) };
        let mut reference = ReferenceGenerator::new(&at_end);
        assert_ne!(reference.verify_start(&at_end, &at_rest(&pose)), Err(Limit::Stroke.into()), "at rest");
        if reference.verify_start(&at_end, &Motion { twist, ..at_rest(&pose) }).is_err() {
            refused += 1;
            continue;
        }
        begun += 1;
        reference.verify_start(&at_end, &Motion { twist, ..at_rest(&pose) }).ok();
        reference.begin_placed_motion(0);
        let mut time_ns = 0;
        while !reference.is_at_rest() {
            time_ns += MS / 10;
            reference.advance(&at_end, time_ns, None);
            let lengths = leg_lengths(&machine, &reference.motion().pose);
            let excess = lengths.into_iter().fold(0.0, f64::max) - machine.actuator.max_length_m;
            assert!(excess <= 0.0, "{excess:e} m beyond the end stop, {gap:e} m from it at the start");
        }
    }
    assert!(refused > 300 && begun > 200, "{refused} {begun}");
}

/// Both ends of the step keep the velocity limit. The middle exceeds it by `J h^2 / 8`.
#[test]
fn a_step_that_exceeds_the_velocity_between_its_ends_is_refused() {
    for part in 0..2 {
        for (excess, is_accepted) in [(0.9, false), (1.1, true)] {
            let (h, speed) = (1e-3, 0.5);
            let limits = [LIMITS.orientation, LIMITS.position][part];
            let constants = constants(|_, parameters| {
                let limits = &mut parameters.limits;
                let limits = if part == 0 { &mut limits.orientation } else { &mut limits.position };
                limits.velocity = speed + excess * limits.jerk * h * h / 8.0;
            });
            let mut motion = at_rest(constants.home.pose());
            let vectors = [Vector3::x() * speed, Vector3::x() * (0.5 * limits.jerk * h)];
            if part == 0 {
                (motion.twist.angular, motion.acceleration.angular) = (vectors[0], vectors[1]);
            } else {
                (motion.twist.linear, motion.acceleration.linear) = (vectors[0], vectors[1]);
            }
            let mut reference = started(&constants, &motion);
            let setpoint = standing(&constants, [0.0; 6]);
            reference.advance(&constants, MS, Some(&Target::Motion(&setpoint)));
            assert_eq!(!matches!(reference.stop.phase, Phase::Followed), is_accepted, "{part} {excess}");
            assert_eq!(reference.active_limits().contains(Limit::Velocity), !is_accepted);
        }
    }
}

/// Rounding has left the reference slightly beyond a bound. It may return, but may not go farther.
#[test]
fn a_reference_beyond_a_bound_by_rounding_only_returns() {
    for limit in [Limit::Stroke, Limit::Envelope, Limit::Condition] {
        let mut constants = constants(|_, parameters| {
            parameters.envelope = around_home([1.0; 6]).filter(|_| limit == Limit::Envelope);
        });
        let aside = [0.0, 0.0, 0.0, 0.2, 0.1, 0.2];
        let pose = standing(&constants, aside).motion.pose;
        let condition = KinematicState::new(constants.machine(), pose).sensitivity().condition;
        let mut reference = started(&constants, &at_rest(&pose));
        match limit {
            Limit::Stroke => {
                let longest = leg_lengths(constants.machine(), &pose).into_iter().fold(0.0, f64::max);
                reference.bounds.longest_m = [longest - 1e-7; LEGS];
            }
            Limit::Envelope => {
                let x = task_coordinates(&pose, &constants.machine().home);
                reference.bounds.envelope.as_mut().unwrap().highest = x.map(|x| x - 1e-8);
            }
            _ => {
                constants.max_reference_condition = condition * (1.0 - 1e-5);
                constants.parameters.max_condition = condition * 1.1;
            }
        }
        let mut away = reference.clone();
        let there = standing(&constants, aside.map(|x| 1.5 * x));
        run(&constants, &mut away, &Target::Motion(&there), 300);
        let moved = (away.motion().pose.position - pose.position).norm();
        assert!(moved < 1e-5, "{limit:?}: {moved}");
        let home = standing(&constants, [0.0; 6]);
        run(&constants, &mut reference, &Target::Motion(&home), 1500);
        let left = (reference.motion().pose.position - home.motion.pose.position).norm();
        assert!(left < 1e-6, "{limit:?}: {left}");
    }
}

/// Under "limit" the walls keep 0.5 % of the stroke from a bound, for a setpoint beyond the limits. A trajectory that keeps
/// them may go as near as it can be stopped.
#[test]
fn walls_keep_their_distance_under_limit_and_beyond_limits_only() {
    let (stop, limit) = (ViolationPolicy::Stop, ViolationPolicy::Limit);
    for (policy, keeps_limits) in [(stop, false), (limit, true), (limit, false)] {
        let are_walls_used = policy == limit && !keeps_limits;
        let constants = constants(|_, parameters| {
            parameters.on_violation = policy;
            parameters.envelope = around_home([0.4, 0.4, 0.4, 0.2, 0.2, 0.2]);
        });
        let kept = 5e-3 * constants.machine().actuator.stroke();
        for (axis, end, kept) in [(3, 0.2_f64, kept), (2, -0.4, kept / constants.machine().joints.radius_m)] {
            let near = 0.3 * kept;
            let mut offset = [0.0; 6];
            offset[axis] = end - near * end.signum();
            let setpoint = standing(&constants, offset);
            let mut reference = started(&constants, &at_rest(constants.home.pose()));
            reference.set_keeps_limits(keeps_limits);
            run(&constants, &mut reference, &Target::Motion(&setpoint), 3000);
            let left = end.abs() - x(&constants, &reference)[axis].abs();
            let expected = if are_walls_used { kept } else { near };
            assert!(
                (left - expected).abs() < 1e-6,
                "{policy:?} {keeps_limits} {axis}: {left}, not {expected}"
            );
            assert_eq!(reference.active_limits().contains(Limit::Envelope), are_walls_used);
        }
    }
}

/// The reference holds, and without a target follows, the stop that was verified at the start. It comes to rest where the stop ends,
/// and reports rest only there.
#[test]
fn a_start_holds_the_stop_that_was_verified_and_ends_where_it_does() {
    for (half, expected) in [(1.0, StopKind::ReleaseFirst), (0.05, StopKind::BrakeAtOnce)] {
        let constants = constants(|_, parameters| parameters.envelope = around_home([half; 6]));
        let mut motion = at_rest(constants.home.pose());
        if half < 1.0 {
            (motion.twist.linear.x, motion.pose.position.x) = (-0.2, 0.047);
        } else {
            motion.twist.linear = Vector3::new(0.1, 0.2, 0.3);
            motion.acceleration.linear = Vector3::new(1.0, 0.0, -2.0);
        }
        let mut reference = started(&constants, &motion);
        let Phase::Verified(kind) = reference.stop.phase else { panic!("no stop is held") };
        assert_eq!(kind, expected, "{half}");
        let stop = PoseStop::new(kind, &motion, &constants.parameters.limits);
        let mut at_rest_after = None;
        for k in 1..=400_u64 {
            assert!(!reference.is_at_rest() || at_rest_after.is_some());
            reference.advance(&constants, k * MS, None);
            let expected = stop.state_at(Level::new(), k as f64 * 1e-3).position;
            let found = reference.motion();
            assert!((found.twist.linear - expected.velocity).norm() < 1e-9, "{half} {k}");
            let moved = found.pose.position - motion.pose.position;
            assert!((moved - expected.displacement).norm() < 1e-9, "{half} {k}");
            if reference.is_at_rest() {
                at_rest_after.get_or_insert(k);
            }
        }
        assert_eq!(at_rest_after, Some((stop.duration() * 1e3).ceil() as u64));
    }
    // A reference that never began is at rest and stays where it is.
    let constants = constants(|_, _| ());
    let mut reference = ReferenceGenerator::new(&constants);
    assert!(reference.is_at_rest());
    reference.advance(&constants, MS, None);
    assert!(reference.is_at_rest() && reference.motion() == &at_rest(constants.home.pose()));
}

/// An axis of the envelope without width does not prevent motion along the others.
#[test]
fn the_platform_moves_beside_locked_axes() {
    let constants = constants(|_, parameters| {
        parameters.envelope = around_home([0.0, 0.0, 0.5, 0.0, 0.0, 0.5]);
        for limits in [&mut parameters.limits.position, &mut parameters.limits.orientation] {
            (limits.acceleration, limits.jerk) = (0.2 * limits.acceleration, 0.1 * limits.jerk);
        }
    });
    let there = standing(&constants, [0.0, 0.0, 0.3, 0.0, 0.0, 0.2]);
    let mut reference = started(&constants, &at_rest(constants.home.pose()));
    run(&constants, &mut reference, &Target::Motion(&there), 4000);
    let found = x(&constants, &reference);
    assert!((found[2] - 0.3).abs() < 1e-6 && (found[5] - 1.7).abs() < 1e-6, "{found:?}");
    assert!([0, 1, 3, 4].iter().all(|axis| found[*axis].abs() < 2e-9), "{found:?}");
}
