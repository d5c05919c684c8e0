//! Tests of quantities whose extremes lie between the knots of an examined stop, or within the step before
//! it.

use crate::control::reference::tests::verification::{Bound, PlayedStep, ROOM_RATIO, Scene};
use crate::control::reference::tests::*;

/// Platform at rest at home, with scaled limits of acceleration and jerk. Every bound is wide.
pub(super) fn scene(samples: &mut RandomVectors, acceleration: f64, jerk: f64) -> Scene {
    let mut scene = Scene::new(samples);
    let limits = &mut scene.constants.parameters.limits;
    *limits = LIMITS;
    for limits in [&mut limits.position, &mut limits.orientation] {
        limits.acceleration *= acceleration;
        limits.jerk *= jerk;
    }
    scene.constants.max_reference_condition = 1e9;
    scene.constants.parameters.max_condition = 1e9;
    scene.motion = Motion {
        pose: *scene.constants.home.pose(),
        twist: Twist::default(),
        acceleration: Acceleration::default(),
    };
    let still = Acceleration { angular: Vector3::zeros(), linear: Vector3::zeros() };
    scene.step = PlayedStep { from: None, duration: 1e-3, jerk: still };
    scene.is_free = false;
    scene
}

/// A coordinate turns back early in a long stop: its velocity is small and against the acceleration, the
/// velocity across is large.
#[test]
fn coordinates_that_turn_back_between_knots_keep_the_envelope() {
    let mut samples = RandomVectors::new(81);
    let mut largest = [f64::NEG_INFINITY; 2];
    for k in 0..600 {
        let [acceleration, jerk] = [[1.0, 1.0], [0.2, 0.1], [0.05, 0.05]][k % 3];
        let mut scene = scene(&mut samples, acceleration, jerk);
        let axis = [0, 2, 3, 4][k / 3 % 4];
        let limits = scene.constants.parameters.limits;
        let part = if axis < 3 { limits.orientation } else { limits.position };
        let along: Vector3<f64> = Vector3::ith(axis % 3, 1.0);
        let across: Vector3<f64> = Vector3::ith((axis + 1) % 3, 1.0);
        let size = 0.5 * part.acceleration * part.acceleration / part.jerk * samples.uniform();
        let velocity = along * size + across * (0.6 * part.velocity * samples.uniform());
        let acceleration = along * -part.acceleration;
        let Motion { twist, acceleration: a, pose } = &mut scene.motion;
        if axis < 3 {
            // The platform is tilted, so that angles change faster than the attitude turns.
            pose.rotation = exp(&(Vector3::y() * samples.uniform()));
            (twist.angular, a.angular) = (velocity, acceleration);
        } else {
            (twist.linear, a.linear) = (velocity, acceleration);
        }
        // The step starts within the bound: if it started beyond, the stop could be as far beyond.
        let way = along * -0.01;
        let way = if axis < 3 { [way, Vector3::zeros()] } else { [Vector3::zeros(), way] };
        scene.step.from = Some(scene.motion.pose.displaced(&Twist { angular: way[0], linear: way[1] }));
        let Some(excess) = scene.excess(Bound::Highest(axis)) else { continue };
        largest[axis / 3] = largest[axis / 3].max(excess);
    }
    assert!(largest.iter().all(|excess| *excess > -1e-3), "{largest:?}");
}

/// An angle turns back although the attitude does not, because the axis of rotation leads around it.
#[test]
fn angles_that_turn_back_by_their_geometry_keep_the_envelope() {
    let mut samples = RandomVectors::new(87);
    let mut count = 0;
    for k in 0..300 {
        let mut scene = scene(&mut samples, 0.05, 0.05);
        let axis = 2 * (k % 2);
        scene.motion.pose.rotation = exp(&(Vector3::y() * (0.5 + 0.4 * samples.uniform())));
        let home = scene.constants.machine().home;
        let of = |twist: Vector3<f64>| {
            let twist = Twist { angular: twist, linear: Vector3::zeros() };
            task_coordinates(&scene.motion.pose.displaced(&twist), &home)[axis]
        };
        let gradient =
            Vector3::from_fn(|i, _| (of(Vector3::ith(i, 1e-6)) - of(Vector3::ith(i, -1e-6))) / 2e-6);
        let turning = Vector3::from_fn(|_, _| 2.0 * samples.uniform() - 1.0).normalize();
        let across = turning - gradient * (gradient.dot(&turning) / gradient.norm_squared());
        scene.motion.twist.angular = across + gradient * (0.03 * samples.uniform());
        scene.step.from =
            Some(scene.motion.pose.displaced(&Twist { angular: gradient * -0.01, linear: Vector3::zeros() }));
        let Some((extremes, bound)) = scene.tightened(Bound::Highest(axis)) else { continue };
        // Stops through gimbal lock are left out, because the angles jump there.
        if extremes.highest[1].max(-extremes.lowest[1]) > 1.2 {
            continue;
        }
        count += 1;
        let excess = extremes.highest[axis] - bound;
        let room = ROOM_RATIO * scene.constants.machine().actuator.stroke() / scene.constants.arm_m;
        assert!(excess <= room, "axis {axis}: {excess} {:?}", scene.motion);
    }
    assert!(count > 50, "{count}");
}

/// A leg turns back between two knots: the velocity is along the leg, against the acceleration.
#[test]
fn lengths_and_rates_that_turn_back_between_knots_keep_their_bounds() {
    let mut samples = RandomVectors::new(82);
    let mut largest = [f64::NEG_INFINITY; 2];
    for k in 0..400 {
        let [acceleration, jerk] = [[1.0, 1.0], [0.2, 0.1]][k % 2];
        let mut scene = scene(&mut samples, acceleration, jerk);
        let leg = k % LEGS;
        let machine = scene.constants.machine();
        let moved = |axis| {
            let mut moved = scene.motion;
            moved.twist.linear = Vector3::ith(axis, 1.0);
            leg_motion(machine, &moved).rate_m_s[leg]
        };
        let direction = Vector3::from_fn(|axis, _| moved(axis));
        let across = direction.cross(&Vector3::z()).normalize();
        let limits = scene.constants.parameters.limits.position;
        let size = 0.5 * limits.acceleration * limits.acceleration / limits.jerk;
        let stroke = machine.actuator.stroke();
        if k % 4 < 2 {
            let velocity = direction * (size * samples.uniform()) + across * (0.5 * samples.uniform());
            scene.motion.twist.linear = velocity;
            scene.motion.acceleration.linear = direction * -limits.acceleration;
            let Some(excess) = scene.excess(Bound::Longest(leg)) else { continue };
            largest[0] = largest[0].max(excess / stroke);
        } else {
            scene.motion.twist.linear = direction * (0.5 * samples.uniform());
            scene.motion.acceleration.linear = direction * (limits.acceleration * samples.uniform());
            let Some(excess) = scene.excess(Bound::Rate) else { continue };
            largest[1] = largest[1].max(excess);
        }
    }
    assert!(largest[0] > -1e-4 && largest[1] > -0.02, "{largest:?}");
}

/// A step ends where it began and turns back in its middle. Speeds, lengths and coordinates are largest
/// within the step.
#[test]
fn the_middle_of_a_long_step_keeps_every_bound() {
    let mut samples = RandomVectors::new(83);
    for (part, duration) in [(0, 0.3), (1, 0.3), (0, 0.02), (1, 0.02)] {
        let mut scene = scene(&mut samples, 1.0, 1.0);
        scene.step.duration = duration;
        let limits = LIMITS;
        let size = [limits.orientation, limits.position][part].acceleration;
        let (v, a) = (Vector3::z() * (-0.5 * size * duration), Vector3::z() * -size);
        let Motion { twist, acceleration, pose } = &mut scene.motion;
        if part == 0 {
            (twist.angular, acceleration.angular) = (v, a);
        } else {
            (twist.linear, acceleration.linear) = (v, a);
        }
        scene.constants.parameters.limits.position.velocity = 10.0;
        scene.constants.parameters.limits.orientation.velocity = 10.0;
        // Backward from the end of the step.
        let middle = pose.displaced(&Twist {
            angular: twist.angular * (-0.25 * duration),
            linear: twist.linear * (-0.25 * duration),
        });
        let axis = [2, 5][part];
        let machine = scene.constants.machine().clone();
        let of = |pose: &Pose| (leg_lengths(&machine, pose), task_coordinates(pose, &machine.home)[axis]);
        let (lengths, x) = of(&middle);
        for (leg, length) in lengths.iter().enumerate() {
            let (_, bound) = scene.tightened(Bound::Longest(leg)).unwrap();
            let excess = length - bound;
            assert!(excess <= ROOM_RATIO * machine.actuator.stroke(), "{part} {duration} {leg}: {excess}");
            scene.bounds.longest_m[leg] = 100.0;
        }
        // Angles are left out: their bound holds only for steps that are no longer than the time between
        // knots.
        if part == 1 {
            let (_, bound) = scene.tightened(Bound::Highest(axis)).unwrap();
            assert!(x - bound <= 1e-9, "{duration}: {}", x - bound);
        }
    }
}

/// The speed in the middle of a step exceeds the speed at both ends by an eighth of the change of
/// acceleration times the step.
#[test]
fn the_speed_in_the_middle_of_a_step_is_within_a_limit_that_is_just_accepted() {
    let mut samples = RandomVectors::new(84);
    for (part, is_free) in [(0, false), (1, false), (0, true), (1, true)] {
        let mut scene = scene(&mut samples, 1.0, 1.0);
        scene.is_free = is_free;
        if !is_free {
            // There is no room in any direction, so the stop is examined.
            scene.bounds.envelope.as_mut().unwrap().lowest =
                task_coordinates(&scene.motion.pose, &scene.constants.machine().home).map(|x| x - 1e-3);
        }
        let (speed, h) = (0.5, 1e-2);
        let jerk = [LIMITS.orientation, LIMITS.position][part].jerk;
        let vectors = [speed, -0.5 * jerk * h, -jerk].map(|size| Vector3::x() * size);
        let Motion { twist, acceleration, .. } = &mut scene.motion;
        let pairs = if part == 0 {
            (&mut twist.angular, &mut acceleration.angular, &mut scene.step.jerk.angular)
        } else {
            (&mut twist.linear, &mut acceleration.linear, &mut scene.step.jerk.linear)
        };
        (*pairs.0, *pairs.1, *pairs.2) = (vectors[0], vectors[1], vectors[2]);
        scene.step.duration = h;
        let (extremes, bound) = scene.tightened(Bound::Speed(1 - part)).unwrap();
        let middle = speed + jerk * h * h / 8.0;
        let found = extremes.speeds[1 - part];
        assert!((found / middle - 1.0).abs() < 1e-9 && (bound / middle - 1.0).abs() < 1e-8, "{bound}");
    }
}

/// The rate of a leg is largest in the middle of a long step, where the acceleration changes sign.
#[test]
fn the_rate_in_the_middle_of_a_long_step_is_within_a_limit_that_is_just_accepted() {
    let mut samples = RandomVectors::new(95);
    for h in [0.03, 0.05] {
        let mut scene = scene(&mut samples, 1.0, 1.0);
        let (v, jerk) = (Vector3::z() * 0.3, Vector3::z() * -LIMITS.position.jerk);
        let a = jerk * (0.5 * h);
        let Motion { pose, twist, acceleration } = &mut scene.motion;
        (twist.linear, acceleration.linear, scene.step.jerk.linear) = (v, a, jerk);
        scene.step.duration = h;
        // Backward from the end of the step.
        let t = -0.5 * h;
        let middle = Motion {
            pose: Pose { position: pose.position + (v + (a + jerk * (t / 3.0)) * (t / 2.0)) * t, ..*pose },
            twist: Twist { linear: v + (a + jerk * (t / 2.0)) * t, ..*twist },
            ..scene.motion
        };
        let rates = leg_motion(scene.constants.machine(), &middle).rate_m_s;
        let rate = rates.into_iter().fold(0.0_f64, |largest, rate| largest.max(rate.abs()));
        let (_, bound) = scene.tightened(Bound::Rate).unwrap();
        assert!(rate <= bound && rate > 0.8 * bound, "{h}: {rate} {bound}");
    }
}

/// At knots the condition keeps the limit of the reference, whatever the limit of the platform.
#[test]
fn the_condition_at_knots_keeps_the_limit_of_the_reference() {
    let mut samples = RandomVectors::new(86);
    let mut count = [0; 2];
    for _ in 0..300 {
        let mut scene = Scene::new(&mut samples);
        scene.constants.parameters.max_condition = 1e9;
        let before =
            KinematicState::new(scene.constants.machine(), scene.motion.pose).sensitivity().condition;
        let Some((extremes, bound)) = scene.tightened(Bound::ReferenceCondition) else { continue };
        let worst = 1.0 / extremes.inverse_condition;
        // If the step began beyond the limit, the stop may go as far.
        let allowed = bound.max(before) * if scene.is_free { 1.0 + 1e-9 } else { 1.01 };
        assert!(worst > 0.0 && worst <= allowed, "{worst} {bound}");
        count[usize::from(scene.is_free)] += 1;
    }
    assert!(count.iter().all(|count| *count > 50), "{count:?}");
}
