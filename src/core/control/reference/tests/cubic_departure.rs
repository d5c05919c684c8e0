//! Tests of the bounds on derivatives of lengths, term by term, and on the departure between two knots.

use crate::control::reference::proof::cubic_departure::{
    CUBIC_DEPARTURE_RATIO, CUBIC_RATE_DEPARTURE_RATIO, length_acceleration_bound, length_jerk_bound,
};
use crate::control::reference::tests::between_knots::scene;
use crate::control::reference::tests::*;

/// The largest second derivative of a length is close to its bound, for one limit or velocity at a time: each
/// term is needed.
#[test]
fn no_length_is_curved_more_than_its_bound() {
    let mut samples = RandomVectors::new(85);
    let mut used = [0.0_f64; 3];
    for k in 0..6000 {
        let (term, mut scene) = (k % 3, scene(&mut samples, 1.0, 1.0));
        scene.motion.pose = pose(&mut samples, &scene.constants);
        let limits = &mut scene.constants.parameters.limits;
        let sizes = [[1.0, 1.0, 0.0, 0.0], [1e-3, 1e-3, 0.0, 1.0], [1e-3, 1e-3, 1.0, 0.0]][term];
        limits.position.acceleration *= sizes[0];
        limits.orientation.acceleration *= sizes[1];
        let [a, alpha] = [limits.position.acceleration, limits.orientation.acceleration];
        let unit = |samples: &mut RandomVectors| samples.vector(1.0);
        scene.motion.twist =
            Twist { angular: unit(&mut samples) * sizes[3], linear: unit(&mut samples) * sizes[2] };
        scene.motion.acceleration =
            Acceleration { angular: unit(&mut samples) * alpha, linear: unit(&mut samples) * a };
        let bound = length_acceleration_bound(&scene.constants, sizes[2], sizes[3]);
        let legs = leg_motion(scene.constants.machine(), &scene.motion);
        let largest = legs.accel_m_s2.iter().fold(0.0_f64, |largest, accel| largest.max(accel.abs()));
        used[term] = used[term].max(largest / bound);
    }
    assert!(used.iter().all(|used| (0.4..=1.0).contains(used)), "{used:?}");
}

/// The third derivative of a function is 1 or -1. The function departs from the cubic with its values and
/// rates at 0 and 1 by no more than the bound, and by almost as much.
#[test]
fn a_function_departs_from_its_cubic_by_no_more_than_its_bound() {
    let mut samples = RandomVectors::new(89);
    let mut largest = [0.0_f64; 2];
    for _ in 0..200_000 {
        let mut switches = [0.0, samples.uniform(), samples.uniform(), 1.0];
        switches.sort_by(f64::total_cmp);
        // The integral of `(t - s)^2 / 2` times the third derivative at s, and the rate of this integral.
        let f = |t: f64| {
            let parts = switches.windows(2).zip([1.0, -1.0, 1.0]);
            parts.fold([0.0; 2], |[value, rate], (ends, jerk)| {
                let [a, b] = [(t - ends[0]).max(0.0), (t - ends[1]).max(0.0)];
                [value + jerk * (a.powi(3) - b.powi(3)) / 6.0, rate + jerk * (a * a - b * b) / 2.0]
            })
        };
        let (t, [end, end_rate]) = (samples.uniform(), f(1.0));
        let cubic = end * t * t * (3.0 - 2.0 * t) + end_rate * t * t * (t - 1.0);
        let cubic_rate = 6.0 * end * t * (1.0 - t) + end_rate * t * (3.0 * t - 2.0);
        let [value, rate] = f(t);
        largest[0] = largest[0].max((value - cubic).abs() / CUBIC_DEPARTURE_RATIO);
        largest[1] = largest[1].max((rate - cubic_rate).abs() / CUBIC_RATE_DEPARTURE_RATIO);
    }
    assert!(largest.iter().all(|largest| (0.94..=1.0).contains(largest)), "{largest:?}");
}

/// The largest third derivative of a length is close to its bound, for one limit or velocity at a time, or
/// two that belong together: each term is needed.
#[test]
fn no_length_has_a_third_derivative_beyond_its_bound() {
    const H: f64 = 1e-4;
    let mut samples = RandomVectors::new(88);
    let mut used = [0.0_f64; 5];
    for k in 0..10_000 {
        let (term, mut scene) = (k % 5, scene(&mut samples, 1.0, 1.0));
        // Jerk; turning; shifting; shifting and acceleration; turning and acceleration.
        let [jerk, acceleration, v, w] = [
            [1.0, 1e-6, 0.0, 0.0],
            [1e-6, 1e-6, 0.0, 2.0],
            [1e-6, 1e-6, 2.0, 0.0],
            [1e-6, 1.0, 2.0, 0.0],
            [1e-6, 1.0, 0.0, 1.0],
        ][term];
        for limits in [
            &mut scene.constants.parameters.limits.position,
            &mut scene.constants.parameters.limits.orientation,
        ] {
            limits.jerk *= jerk;
            limits.acceleration *= acceleration;
        }
        let Limits { position, orientation, .. } = scene.constants.parameters.limits;
        let unit = |samples: &mut RandomVectors| samples.vector(1.0).normalize();
        let mut pair = |angular: f64, linear: f64| Twist {
            angular: unit(&mut samples) * angular,
            linear: unit(&mut samples) * linear,
        };
        let (velocity, change, jerk) = (
            pair(w, v),
            pair(orientation.acceleration, position.acceleration),
            pair(orientation.jerk, position.jerk),
        );
        let pose = pose(&mut samples, &scene.constants);
        let accel = |t: f64| {
            let along = |a: f64, b: f64, c: f64| {
                Twist::from_vector(&(velocity.vector() * a + change.vector() * b + jerk.vector() * c))
            };
            let acceleration = along(0.0, 1.0, t);
            let motion = Motion {
                pose: pose.displaced(&along(t, 0.5 * t * t, 0.0)),
                twist: along(1.0, t, 0.5 * t * t),
                acceleration: Acceleration { angular: acceleration.angular, linear: acceleration.linear },
            };
            leg_motion(scene.constants.machine(), &motion).accel_m_s2
        };
        // The shortest leg decides.
        let mut machine = scene.constants.machine().clone();
        machine.actuator.min_length_m =
            leg_lengths(&machine, &pose).into_iter().fold(f64::INFINITY, f64::min);
        let constants = Constants::new(&machine, scene.constants.parameters);
        let bound = length_jerk_bound(&constants, v, w);
        let largest =
            accel(H).into_iter().zip(accel(-H)).map(|(after, before)| ((after - before) / (2.0 * H)).abs());
        used[term] = used[term].max(largest.fold(0.0, f64::max) / bound);
    }
    assert!(used.iter().all(|used| (0.3..=1.0).contains(used)), "{used:?}");
}
