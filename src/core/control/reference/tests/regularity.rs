//! Tests of the balls of poses: hill climbing for a pose beyond the limit of the condition, beyond a singular
//! pose, or with a leg that is nearer to the axis of its universal joint than the limit.

use crate::control::reference::tests::*;

/// Pose of a ball for six numbers: rotation and shift as ratios of the largest ones.
fn within(center: &Pose, Pair { angular: turn, linear: shift }: Pair<f64>, numbers: &Vector6<f64>) -> Pose {
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

/// Smallest value that hill climbing finds in a ball, with so many starts and steps.
fn lowest(
    samples: &mut RandomVectors,
    center: &Pose,
    reach: Pair<f64>,
    [starts, steps]: [u32; 2],
    value: impl Fn(&Pose) -> f64,
) -> f64 {
    let value = |numbers: &Vector6<f64>| value(&within(center, reach, numbers));
    let climbed = |_| {
        let mut best = Vector6::from_fn(|_, _| 2.0 * samples.uniform() - 1.0);
        let (mut lowest, mut step) = (value(&best), 1.0);
        for _ in 0..steps {
            let next = best + Vector6::from_fn(|_, _| step * (2.0 * samples.uniform() - 1.0));
            let found = value(&next);
            if found < lowest { (best, lowest) = (next, found) } else { step = (0.97_f64 * step).max(0.02) }
        }
        lowest
    };
    (0..starts).map(climbed).fold(f64::INFINITY, f64::min)
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
            let worst = |pose: &Pose| inverse_condition(&constants, pose);
            let found = lowest(&mut samples, &center, reach(size), [3, 120], worst);
            let used = 1.0 / (found * constants.max_reference_condition);
            assert!(size == 0.0 || found > 0.0 && used <= 1.0 + 1e-9, "{used}, {size}, {center:?}");
            closest = if size > 0.0 { closest.max(used) } else { closest };
            accepted += u32::from(size > 0.0);
        }
    }
    assert!(accepted > 150 && closest > 0.8, "{accepted} balls, {closest}");
}

#[test]
fn no_leg_of_a_ball_just_accepted_is_nearer_to_its_axis_than_the_limit() {
    let mut samples = RandomVectors::new(17);
    let (mut closest, mut accepted) = (f64::INFINITY, 0);
    for _ in 0..40 {
        let machine = machine(&mut samples);
        let mut constants = Constants::new(&machine, parameters(&machine));
        (constants.max_reference_condition, constants.parameters.max_condition) = (1e9, 1e9);
        let center = pose(&mut samples, &constants);
        constants.least_universal_sine = universal_sine(&machine, &center) * samples.uniform();
        let [linear, angular] = [samples.uniform(), samples.uniform()].map(|u| if u < 0.3 { 0.0 } else { u });
        let ratio = Pair { angular, linear };
        let reach = |size: f64| ratio.map(|ratio| ratio * size);
        let size = bisected(0.0, 2.0, |size| {
            is_covered(&mut RegularBalls::default(), &constants, &center, reach(size))
        });
        let sine = |pose: &Pose| universal_sine(&machine, pose);
        let found =
            lowest(&mut samples, &center, reach(size), [1, 200], sine) / constants.least_universal_sine;
        assert!(found >= 1.0 - 1e-9, "{found}, {size}, {ratio:?}, {center:?}");
        if size > 0.0 {
            (closest, accepted) = (closest.min(found), accepted + 1);
        }
    }
    assert!(accepted > 20 && closest < 1.1, "{accepted}, {closest}");
}
