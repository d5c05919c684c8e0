//! Tests of the reference between the ends of its steps, against an integration of its acceleration in short
//! steps.

use crate::control::reference::history::History;
use crate::control::reference::stop::constant_jerk::step_to_acceleration;
use crate::control::reference::tests::*;

/// Motion around home in every coordinate.
fn moving(samples: &mut RandomVectors, constants: &Constants) -> Motion {
    let twist = Twist { angular: samples.vector(0.4), linear: samples.vector(0.4) };
    let acceleration = Acceleration { angular: samples.vector(3.0), linear: samples.vector(3.0) };
    Motion { twist, acceleration, ..at_rest(&pose(samples, constants)) }
}

/// Motion `dt` seconds later at constant jerk. The attitude is integrated in short steps, by the angular
/// velocity in the middle of each.
fn integrated(motion: &Motion, jerk: &Vector6<f64>, dt: f64) -> Motion {
    let (v, a) = (motion.twist.vector(), motion.acceleration.vector());
    let twist = |t: f64| Twist::from_vector(&(v + a * t + jerk * (0.5 * t * t)));
    let mut pose = motion.pose;
    for k in 0..200 {
        let h = dt / 200.0;
        let middle = twist((f64::from(k) + 0.5) * h);
        pose.rotation = exp(&(middle.angular * h)) * pose.rotation;
        pose.position += middle.linear * h;
    }
    Motion { pose, twist: twist(dt), acceleration: Acceleration::from_vector(&(a + jerk * dt)) }
}

fn assert_near(a: &Motion, b: &Motion, tolerances: [f64; 3]) {
    let apart = [
        a.pose.displacement_to(&b.pose).vector().norm(),
        (a.twist.vector() - b.twist.vector()).norm(),
        (a.acceleration.vector() - b.acceleration.vector()).norm(),
    ];
    assert!(apart.iter().zip(tolerances).all(|(apart, tolerance)| *apart <= tolerance), "{apart:?}");
}

#[test]
fn the_history_returns_the_motion_of_each_instant() {
    let mut samples = RandomVectors::new(31);
    let constants = random_constants(&mut samples);
    let mut history = History::default();
    assert!(history.motion_at(0).is_none());
    let mut motion = moving(&mut samples, &constants);
    let mut recorded = vec![];
    for k in 0..700_u64 {
        let next = Vector6::from_fn(|_, _| 6.0 * samples.uniform() - 3.0);
        let jerk = (next - motion.acceleration.vector()) / 1e-3;
        history.record(1000 * MS + k * MS, &motion, &Acceleration::from_vector(&next), 1e-3);
        recorded.push((motion, jerk));
        motion = integrated(&motion, &jerk, 1e-3);
    }
    // In each of the newest 128 segments: at its start, within it, and just before its end.
    #[allow(clippy::needless_range_loop, reason = "the index is the cycle")]
    for k in 572..700_usize {
        let (motion, jerk) = &recorded[k];
        let begin_ns = 1000 * MS + k as u64 * MS;
        for part_ns in [0, 300_000, 999_999] {
            let expected = integrated(motion, jerk, part_ns as f64 * 1e-9);
            let found = history.motion_at(begin_ns + part_ns).unwrap();
            assert_near(&found, &expected, [1e-8, 1e-12, 1e-9]);
        }
    }
    let (last, jerk) = recorded[699];
    let after = history.motion_at(1699 * MS + 1_500_000).unwrap();
    assert_near(&after, &integrated(&last, &jerk, 1.5e-3), [1e-7, 1e-12, 1e-9]);
    // Before the oldest segment: with its acceleration.
    let before = history.motion_at(1571 * MS).unwrap();
    assert_near(&before, &integrated(&recorded[572].0, &Vector6::zeros(), -1e-3), [1e-7, 1e-12, 1e-9]);
    history.clear();
    assert!(history.motion_at(1699 * MS).is_none());
}

/// `deviation_of` against the deviation from the separately extrapolated motion: the remainder is of second
/// order.
#[test]
fn the_deviation_of_a_setpoint_is_right_to_first_order() {
    let mut samples = RandomVectors::new(32);
    let constants = random_constants(&mut samples);
    for _ in 0..200 {
        let motion = moving(&mut samples, &constants);
        let mut reference = ReferenceGenerator::new(&constants);
        reference.verify_start(&constants, &motion).ok();
        reference.begin_placed_motion(1000 * MS);
        let offset = Twist { angular: samples.vector(1e-3), linear: samples.vector(1e-2) };
        let task = TaskState::at_rest(task_coordinates(&motion.pose, &constants.machine().home));
        let mut setpoint = SetpointMotion::new(Setpoint::motion(0, task));
        setpoint.motion = moving(&mut samples, &constants);
        setpoint.motion.pose = motion.pose.displaced(&offset);
        for dt_ns in [0, 4 * MS, 12 * MS] {
            setpoint.setpoint.time_ns = 1000 * MS - dt_ns;
            let dt = dt_ns as f64 * 1e-9;
            let desired = integrated(&setpoint.motion, &Vector6::zeros(), dt);
            let deviation = reference.offset_to_setpoint(&constants.parameters, &setpoint);
            let expected = motion.pose.displacement_to(&desired.pose).vector();
            // Remainder: half of the product of the two rotations.
            let rest = offset.angular.norm() * 0.5 * dt + 0.5 * dt * dt * dt + 1e-9;
            assert!((deviation.pose.vector() - expected).norm() <= rest, "{dt}");
            let twist = desired.twist.vector() - motion.twist.vector();
            assert!((deviation.twist.vector() - twist).norm() <= 1e-12);
        }
    }
}

/// A step of the generator, and a stop that it follows, against the integration of its own acceleration.
#[test]
fn steps_and_stops_move_the_pose_as_their_twist_says() {
    let mut samples = RandomVectors::new(33);
    let constants = random_constants(&mut samples);
    let mut steps = 0;
    for k in 0..100 {
        let mut motion = moving(&mut samples, &constants);
        motion.acceleration = Acceleration::default();
        let mut reference = ReferenceGenerator::new(&constants);
        reference.verify_start(&constants, &motion).ok();
        reference.begin_placed_motion(0);
        let home = at_rest(constants.home.pose()).pose;
        let target = Target::Pose { pose: &home, speed_share: 1.0 };
        let mut expected = motion;
        for step in 1..=200 {
            let target = (k % 2 == 0).then_some(&target);
            reference.advance(&constants, step * MS, target);
            let next = reference.motion();
            let jerk = (next.acceleration.vector() - expected.acceleration.vector()) / 1e-3;
            let moved = integrated(&expected, &jerk, 1e-3);
            // A stop may change its jerk within a step; such steps are left out.
            if (next.twist.vector() - moved.twist.vector()).norm() < 1e-12 {
                assert_near(next, &moved, [1e-9, 1e-12, 1e-9]);
                steps += 1;
            }
            let mean = reference.motion_for_held_force(step * MS - MS / 2).acceleration.vector();
            assert!((expected.twist.vector() + mean * 1e-3 - next.twist.vector()).norm() < 1e-12);
            expected = *next;
        }
        if k % 2 == 1 {
            assert_eq!(reference.is_at_rest(), reference.motion().twist.vector().norm() == 0.0);
        }
    }
    assert!(steps > 15_000, "{steps}");
}

#[test]
fn bounds_that_are_relaxed_around_a_pose_follow_it_back_and_never_out() {
    let mut samples = RandomVectors::new(34);
    let machine = machine(&mut samples);
    let mut parameters = parameters(&machine);
    parameters.stroke_margin_m = 0.1;
    parameters.envelope = Some(Envelope {
        lowest: [-0.1, -0.1, -0.1, -0.1, -0.1, 1.4],
        highest: [0.1, 0.1, 0.1, 0.1, 0.1, 1.6],
    });
    let constants = Constants::new(&machine, parameters);
    let nominal = PoseBounds::configured(&constants);
    let [shortest, longest] = [machine.actuator.min_length_m + 0.1, machine.actuator.max_length_m - 0.1];
    assert_eq!((nominal.shortest_m, nominal.longest_m), ([shortest; LEGS], [longest; LEGS]));
    let room = 2.5e-5 * machine.actuator.stroke();
    // Relaxed bounds keep two rooms from the end stops.
    let (low, high) =
        (machine.actuator.min_length_m + 2.0 * room, machine.actuator.max_length_m - 2.0 * room);
    let stops = [low, f64::NEG_INFINITY, -high, f64::NEG_INFINITY];
    let ends = |bounds: &PoseBounds| {
        let envelope = bounds.envelope.unwrap();
        [bounds.shortest_m, envelope.lowest, bounds.longest_m.map(|x| -x), envelope.highest.map(|x| -x)]
    };
    for sign in [-1.0, 1.0] {
        let at = |share: f64| {
            let turn = Vector3::new(0.3, 0.25, 0.2) * (share * sign);
            let shift = Vector3::new(0.3, 0.2, 0.9) * (share * sign);
            TaskState::at_rest([turn.x, turn.y, turn.z, shift.x, shift.y, 1.5 + shift.z]).motion().pose
        };
        let mut bounds = PoseBounds::relaxed_to(&constants, &at(1.0));
        let mut before = ends(&bounds);
        let x = task_coordinates(&at(1.0), &machine.home);
        let end = if sign < 0.0 { before[1][0] - x[0] } else { before[3][0] + x[0] };
        assert!((end + room / machine.joints.radius_m).abs() < 1e-12, "{end}");
        for share in [1.0, 0.9, 0.95, 0.5, 0.7, 0.0] {
            bounds.withdraw_relaxation(&constants, &at(share));
            let now = ends(&bounds);
            let lengths = leg_lengths(&machine, &at(share));
            let x = task_coordinates(&at(share), &machine.home);
            let values = [lengths, x, lengths.map(|l| -l), x.map(|x| -x)];
            for (kind, (now, (before, nominal))) in
                now.iter().zip(before.iter().zip(ends(&nominal).iter())).enumerate()
            {
                for axis in 0..6 {
                    let is_angle = kind % 2 == 1 && axis < 3;
                    let room = if is_angle { room / machine.joints.radius_m } else { room };
                    let (value, end) = (values[kind][axis], stops[kind]);
                    let expected = nominal[axis].min((value - room).max(end.min(value))).max(before[axis]);
                    let expected = if values[kind][axis] < nominal[axis] { expected } else { nominal[axis] };
                    assert!((now[axis] - expected).abs() < 1e-12, "{kind} {axis} {share}");
                }
            }
            before = now;
        }
        assert_eq!(ends(&bounds), ends(&nominal));
    }
}

/// A leg half a room from its end stop may return, and has no room towards the end stop.
#[test]
fn relaxed_bounds_keep_their_distance_from_the_end_stops() {
    let free = generator::constants(|_, parameters| parameters.stroke_margin_m = 0.01);
    let pose = free.home.pose();
    let lengths = leg_lengths(free.machine(), pose);
    for is_long in [false, true] {
        let mut machine = free.machine().clone();
        let stroke = machine.actuator.stroke();
        let half_room = 0.5 * 2.5e-5 * stroke;
        let (shortest, longest) =
            lengths.iter().fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), &l| (a.min(l), b.max(l)));
        let at_stop = if is_long { longest } else { shortest };
        machine.actuator.min_length_m =
            if is_long { longest + half_room - stroke } else { shortest - half_room };
        machine.actuator.max_length_m = machine.actuator.min_length_m + stroke;
        let bounds = PoseBounds::relaxed_to(&Constants::new(&machine, free.parameters), pose);
        let bounds = if is_long { bounds.longest_m } else { bounds.shortest_m };
        let leg = lengths.iter().position(|&length| length == at_stop).unwrap();
        assert_eq!(bounds[leg], at_stop, "{is_long}");
    }
}

/// The axis of rotation turns during the step. The attitude is right to fourth order in the step.
#[test]
fn a_long_step_turns_as_its_angular_velocity_says() {
    let mut samples = RandomVectors::new(35);
    let constants = random_constants(&mut samples);
    for _ in 0..200 {
        let motion = moving(&mut samples, &constants);
        let h = 0.02;
        let Acceleration { angular, linear } = motion.acceleration;
        let mut found = motion;
        step_to_acceleration(&mut found, &angular, &linear, h);
        assert_near(&found, &integrated(&motion, &Vector6::zeros(), h), [6e-8, 1e-12, 1e-9]);
    }
}

/// The same for a part of a stop: a wrong sign of the commutator would show.
#[test]
fn a_part_of_a_stop_turns_as_its_angular_velocity_says() {
    let mut samples = RandomVectors::new(36);
    let constants = random_constants(&mut samples);
    for _ in 0..200 {
        let motion = moving(&mut samples, &constants);
        let stop = PoseStop::new(StopKind::ReleaseFirst, &motion, &LIMITS);
        // Shorter than the release of the acceleration, so that the jerk is constant.
        let h = 0.9 * 0.01_f64.min(motion.acceleration.angular.norm() / LIMITS.orientation.jerk);
        let found =
            advanced(&motion.pose, &stop.state_at(Level::new(), 0.0), &stop.state_at(Level::new(), h), h);
        let jerk = motion.acceleration.angular.normalize() * -LIMITS.orientation.jerk;
        let jerk = if h > 0.0 { jerk } else { Vector3::zeros() };
        let whole = Acceleration { angular: jerk, linear: Vector3::zeros() };
        let expected = integrated(&motion, &whole.vector(), h).pose;
        assert!(found.displacement_to(&expected).angular.norm() < 2e-9, "{h}");
    }
}
