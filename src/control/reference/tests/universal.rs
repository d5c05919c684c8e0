//! Tests of the balls of poses: hill climbing for a leg that is nearer to the axis of its universal joint
//! than the ball's limit.

use nalgebra::Vector6;

use crate::control::reference::proof::regular_balls::RegularBalls;
use crate::control::reference::tests::regularity::within;
use crate::control::reference::tests::*;
use crate::model::inverse_geometry::universal_sine;

/// Smallest sine that hill climbing finds in a ball.
fn least(samples: &mut RandomVectors, constants: &Constants, center: &Pose, reach: Pair<f64>) -> f64 {
    let sine = |numbers: &Vector6<f64>| universal_sine(constants.machine(), &within(center, reach, numbers));
    let mut best = Vector6::from_fn(|_, _| 2.0 * samples.uniform() - 1.0);
    let (mut lowest, mut step) = (sine(&best), 1.0);
    for _ in 0..200 {
        let next = best + Vector6::from_fn(|_, _| step * (2.0 * samples.uniform() - 1.0));
        let value = sine(&next);
        if value < lowest { (best, lowest) = (next, value) } else { step = (0.97_f64 * step).max(0.02) }
    }
    lowest
}

#[test]
fn no_leg_of_a_ball_just_accepted_is_nearer_to_its_axis_than_the_limit() {
    let mut samples = RandomVectors::new(17);
    let (mut closest, mut accepted) = (f64::INFINITY, 0);
    for _ in 0..40 {
        let machine = machine(&mut samples);
        let mut constants = Constants::new(&machine, parameters(&machine));
        (constants.max_reference_condition, constants.parameters.condition) = (1e9, 1e9);
        let center = pose(&mut samples, &constants);
        constants.universal_sine = universal_sine(&machine, &center) * samples.uniform();
        let [linear, angular] = [samples.uniform(), samples.uniform()].map(|u| if u < 0.3 { 0.0 } else { u });
        let ratio = Pair { angular, linear };
        let reach = |size: f64| ratio.map(|ratio| ratio * size);
        let size = bisected(0.0, 2.0, |size| {
            is_covered(&mut RegularBalls::default(), &constants, &center, reach(size))
        });
        let found = least(&mut samples, &constants, &center, reach(size)) / constants.universal_sine;
        assert!(found >= 1.0 - 1e-9, "{found}, {size}, {ratio:?}, {center:?}");
        if size > 0.0 {
            (closest, accepted) = (closest.min(found), accepted + 1);
        }
    }
    println!("{accepted} balls, {closest:.4} of the limit");
    assert!(accepted > 20 && closest < 1.1, "{accepted}, {closest}");
}
