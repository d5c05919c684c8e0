//! Tests of the balls of poses: hill climbing for a pose beyond the limit of the condition, or beyond a
//! singular pose.

use nalgebra::Vector6;

use crate::control::reference::proof::regular_balls::RegularBalls;
use crate::control::reference::tests::*;
use crate::model::rigid::Twist;

/// Pose of a ball for six numbers: rotation and shift as ratios of the largest ones.
pub(super) fn within(
    center: &Pose,
    Pair { angular: turn, linear: shift }: Pair<f64>,
    numbers: &Vector6<f64>,
) -> Pose {
    let part = |k: usize| {
        let v: Vector3<f64> = numbers.fixed_rows::<3>(k).into();
        v / v.norm().max(1.0)
    };
    Pose { rotation: exp(&(part(0) * turn)) * center.rotation, position: center.position + part(3) * shift }
}

/// Inverse condition with the sign of the determinant: 0 at a singular pose.
fn inverse_condition(constants: &Constants, pose: &Pose) -> f64 {
    let state = KinematicState::new(constants.machine(), *pose);
    let sensitivity = state.sensitivity();
    (sensitivity.determinant * constants.home.sensitivity().determinant).signum() / sensitivity.condition
}

/// Smallest inverse condition that hill climbing finds in a ball.
fn worst(samples: &mut RandomVectors, constants: &Constants, center: &Pose, reach: Pair<f64>) -> f64 {
    let mut worst = f64::INFINITY;
    for _ in 0..3 {
        let mut best = Vector6::from_fn(|_, _| 2.0 * samples.uniform() - 1.0);
        let mut lowest = inverse_condition(constants, &within(center, reach, &best));
        let mut step = 1.0;
        for _ in 0..120 {
            let next = best + Vector6::from_fn(|_, _| step * (2.0 * samples.uniform() - 1.0));
            let value = inverse_condition(constants, &within(center, reach, &next));
            if value < lowest { (best, lowest) = (next, value) } else { step = (0.97_f64 * step).max(0.02) }
        }
        worst = worst.min(lowest);
    }
    worst
}

#[test]
fn no_pose_of_a_ball_just_accepted_is_beyond_the_limit() {
    let mut samples = RandomVectors::new(11);
    let (mut closest, mut accepted) = (0.0_f64, 0);
    for _ in 0..12 {
        let machine = machine(&mut samples);
        let mut constants = Constants::new(&machine, parameters(&machine));
        for _ in 0..25 {
            let near = pose(&mut samples, &constants);
            let center = Pose {
                rotation: exp(&samples.vector(0.05)) * near.rotation,
                position: near.position + samples.vector(0.05),
            };
            let at = KinematicState::new(&machine, near).sensitivity().condition;
            constants.max_reference_condition = at * (1.0 + 10.0_f64.powf(3.0 * samples.uniform() - 2.0));
            let [linear, angular] =
                [samples.uniform(), samples.uniform()].map(|u| if u < 0.3 { 0.0 } else { u });
            // The poses of the query are beside the ball that is kept.
            let mut balls = RegularBalls::default();
            if !is_covered(&mut balls, &constants, &near, Pair::default()) {
                continue;
            }
            let ratio = Pair { angular, linear };
            let reach = |size: f64| ratio.map(|ratio| ratio * size);
            let size =
                bisected(0.0, 2.0, |size| is_covered(&mut { balls }, &constants, &center, reach(size)));
            let found = worst(&mut samples, &constants, &center, reach(size));
            let used = 1.0 / (found * constants.max_reference_condition);
            assert!(
                size == 0.0 || found > 0.0 && used <= 1.0 + 1e-9,
                "{used}, {size}, {ratio:?}, {center:?}"
            );
            closest = if size > 0.0 { closest.max(used) } else { closest };
            accepted += u32::from(size > 0.0);
        }
    }
    assert!(accepted > 150 && closest > 0.8, "{accepted} balls, {closest}");
}

/// The bounds of the module's documentation, evaluated with matrices.
#[test]
fn a_ball_ends_where_its_equations_say() {
    use crate::model::inverse_jacobian::scaled_wrenches;
    let mut samples = RandomVectors::new(12);
    for _ in 0..12 {
        let machine = machine(&mut samples);
        let constants = Constants::new(&machine, parameters(&machine));
        let holds = |center: &Pose, Pair { angular: t, linear: d }: Pair<f64>| {
            let wrenches = scaled_wrenches(&machine, center);
            let inverse = wrenches.try_inverse().map_or(f64::INFINITY, |inverse| inverse.norm());
            let shortest = leg_lengths(&machine, center).into_iter().fold(f64::INFINITY, f64::min);
            let s = d + constants.arm * t;
            let q = s / (shortest * (shortest - s)).sqrt();
            let change = (6.0 * q * q + 6.0 * (t + q) * (t + q)).sqrt();
            let norm = (wrenches.norm() + change).min(12.0_f64.sqrt());
            s < shortest
                && inverse * change < 1.0
                && norm * inverse / (1.0 - inverse * change) <= constants.max_reference_condition
        };
        for _ in 0..30 {
            let center = pose(&mut samples, &constants);
            let [linear, angular] = [samples.uniform(), samples.uniform()];
            let ratio = Pair { angular, linear };
            let reach = |size: f64| ratio.map(|ratio| ratio * size);
            // The poses of the query are beside the centre of a kept ball. This ball covers them, or a new
            // one.
            let mut balls = RegularBalls::default();
            assert!(is_covered(&mut balls, &constants, &center, Pair::default()));
            let offset = Twist { angular: samples.vector(0.05), linear: samples.vector(0.05) };
            let beside = center.displaced(&offset);
            let size =
                bisected(0.0, 2.0, |size| is_covered(&mut { balls }, &constants, &beside, reach(size)));
            if is_covered(&mut { balls }, &constants, &beside, reach(size)) {
                let smaller = reach(size * (1.0 - 1e-9));
                let offsets = Pair { angular: offset.angular.norm(), linear: offset.linear.norm() };
                let from_kept = smaller.zip(offsets).map(|(reach, offset)| reach + offset);
                assert!(holds(&center, from_kept) || holds(&beside, smaller), "{size}");
            }
            let prove =
                |size: f64| is_covered(&mut RegularBalls::default(), &constants, &center, reach(size));
            let expected = bisected(0.0, 2.0, |size| holds(&center, reach(size)));
            let own = bisected(0.0, 2.0, prove);
            assert!((own - expected).abs() < 1e-7, "{own} {expected}");
        }
    }
}
