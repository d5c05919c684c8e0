//! Tests of the regularity at the knots of a stop near a bound: at the pose itself, at the poses around it,
//! and the effort.

use crate::control::reference::proof::examination::MAX_STEP_EFFORT;
use crate::control::reference::tests::verification::Scene;
use crate::control::reference::tests::*;

/// Between knots the sine of the angle between a leg and the first axis of its universal joint may be half as
/// large, at a knot it may not. A reference that is there already may return.
#[test]
fn the_universal_joints_at_knots_keep_the_limit_of_the_reference() {
    let mut samples = RandomVectors::new(91);
    for _ in 0..20 {
        let machine = machine(&mut samples);
        let mut constants = Constants::new(&machine, parameters(&machine));
        let pose = pose(&mut samples, &constants);
        (constants.max_reference_condition, constants.parameters.max_condition) = (1e4, 1e9);
        let mut bounds = PoseBounds::configured(&constants);
        (bounds.shortest_m, bounds.longest_m) = ([0.0; LEGS], [100.0; LEGS]);
        let verified = |constants: &Constants, from: Option<&Pose>| {
            let step = Step { from, ..Step::default() };
            Verifier::default().verify(constants, &bounds, &at_rest(&pose), &step, &mut PoseStop::default())
        };
        let sine = universal_sine(&machine, &pose);
        constants.least_universal_sine = 0.99 * sine;
        assert_eq!(verified(&constants, None), Ok(StopKind::ReleaseFirst));
        constants.least_universal_sine = 1.01 * sine;
        assert_eq!(verified(&constants, None), Err(Limit::Condition.into()));
        assert_eq!(verified(&constants, Some(&pose)), Ok(StopKind::BrakeAtOnce));
        constants.least_universal_sine = 2.02 * sine;
        assert_eq!(verified(&constants, Some(&pose)), Err(Limit::Condition.into()));
    }
}

/// A knot needs balls that cover both the knot and the poses around it, which may be less regular.
#[test]
fn a_knot_is_covered_with_the_poses_around_it() {
    let mut samples = RandomVectors::new(92);
    for _ in 0..20 {
        let machine = machine(&mut samples);
        let mut constants = Constants::new(&machine, parameters(&machine));
        let pose = pose(&mut samples, &constants);
        let covered = |balls: &mut RegularBalls, constants: &Constants, reach: f64| {
            let reach = Pair { angular: 0.0, linear: reach };
            dispatch!(machine.level, simd => {
                balls.prove_knot_from_kept(simd, constants, &pose, reach, &mut unlimited_forces(constants))
            })
        };
        let mut balls = RegularBalls::default();
        assert!(!covered(&mut balls, &constants, 0.0));
        // A ball that is too small for the reach is kept for the knot itself.
        assert!(!is_covered(&mut balls, &constants, &pose, Pair { angular: 0.0, linear: 10.0 }));
        assert!(covered(&mut balls, &constants, 0.0) && !covered(&mut balls, &constants, 10.0));
        constants.max_reference_condition = 1.0;
        assert!(!covered(&mut balls, &constants, 0.0));
        // The poses around a knot at the limit may be beyond it, but not beyond the platform's.
        let condition = Conditioning::new(&machine, &pose).sensitivity.condition;
        constants.max_reference_condition = 1.001 * condition;
        constants.parameters.max_condition = 2.0 * condition;
        let mut with_ball = RegularBalls::default();
        assert!(!is_covered(&mut with_ball, &constants, &pose, Pair { angular: 0.0, linear: 0.01 }));
        assert!(covered(&mut with_ball, &constants, 0.01));
        constants.parameters.max_condition = 1.001 * condition;
        assert!(!covered(&mut with_ball, &constants, 0.01));
    }
}

/// A stop that needs more balls than the effort allows is refused. In a later cycle it is accepted, with the
/// balls that were kept.
#[test]
fn a_stop_that_needs_many_balls_is_verified_over_several_cycles() {
    let mut samples = RandomVectors::new(93);
    let mut later = 0;
    for _ in 0..2000 {
        let mut scene = Scene::new(&mut samples);
        scene.constants.parameters.max_condition = 60.0;
        scene.constants.max_reference_condition = 50.0;
        let (mut verifier, mut brake_at_once) = (Verifier::default(), PoseStop::default());
        let mut verified = || {
            verifier.verify(
                &scene.constants,
                &scene.bounds,
                &scene.motion,
                &Step::default(),
                &mut brake_at_once,
            )
        };
        if verified() == Err(Refusal::Effort) {
            later += u32::from((0..3).any(|_| verified().is_ok()));
        }
    }
    assert!(later > 4, "{later}");
}

/// The verification has only the effort that the walls left.
#[test]
fn a_step_without_effort_left_is_refused() {
    let mut samples = RandomVectors::new(95);
    for _ in 0..20 {
        let constants = random_constants(&mut samples);
        let pose = *constants.home.pose();
        let verified = |effort: u32| {
            let step = Step { effort, ..Step::default() };
            Verifier::default().verify(
                &constants,
                &PoseBounds::configured(&constants),
                &at_rest(&pose),
                &step,
                &mut PoseStop::default(),
            )
        };
        assert_eq!(verified(MAX_STEP_EFFORT - 1), Ok(StopKind::ReleaseFirst));
        assert_eq!(verified(MAX_STEP_EFFORT), Err(Refusal::Effort));
    }
}

/// No pose of a stop is farther from a state than the reach around it. Where the velocity is small, some
/// poses are almost as far.
#[test]
fn a_stop_moves_no_farther_than_its_reach() {
    let mut samples = RandomVectors::new(94);
    let mut nearest = [0.0_f64; 2];
    for _ in 0..3000 {
        let part = samples.uniform();
        let Limits { position, orientation, .. } = LIMITS;
        let motion = Motion {
            twist: Twist {
                angular: samples.vector(part * orientation.velocity),
                linear: samples.vector(part * position.velocity),
            },
            acceleration: Acceleration {
                angular: samples.vector(orientation.acceleration),
                linear: samples.vector(position.acceleration),
            },
            ..at_rest(&Pose { rotation: Matrix3::identity(), position: Vector3::zeros() })
        };
        let stop = PoseStop::new(StopKind::BrakeAtOnce, &motion, &LIMITS);
        let (t, dt) = (samples.uniform() * stop.duration(), 0.06 * samples.uniform());
        let state = stop.state_at(Level::new(), t);
        let reach = stop.reach(&state, dt, &LIMITS);
        for other in [(t - 0.5 * dt).max(0.0), t + 0.5 * dt].map(|t| stop.state_at(Level::new(), t)) {
            let moved = [
                (other.position.displacement - state.position.displacement).norm(),
                (other.orientation.displacement - state.orientation.displacement).norm(),
            ];
            for ((nearest, moved), reach) in nearest.iter_mut().zip(moved).zip([reach.linear, reach.angular])
            {
                assert!(moved <= reach * (1.0 + 1e-9), "{moved} {reach} {motion:?}");
                if state.position.velocity.norm().max(state.orientation.velocity.norm()) < 0.02 {
                    *nearest = nearest.max(moved / reach);
                }
            }
        }
    }
    assert!(nearest.iter().all(|nearest| *nearest > 0.9), "{nearest:?}");
}
