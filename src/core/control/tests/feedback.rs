//! Tests of the bound on feedback against its definition: largest share within the bound, time of saturation.
//! Then the last check of the forces.

use crate::control::law::forces::forces;
use crate::control::tests::*;

fn constants(mode: ControlMode) -> Constants {
    let machine = machine(&mut RandomVectors::new(41));
    let mut parameters = parameters(&machine);
    parameters.law.mode = mode;
    parameters.law.max_compensated_acceleration = Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0);
    Constants::new(&machine, parameters)
}

fn cycle(constants: &Constants) -> Cycle<'_> {
    Cycle { constants, release_ns: 0, state: State::Active }
}

#[test]
fn feedback_keeps_its_direction_and_takes_the_largest_share_within_the_bound() {
    let constants = constants(ControlMode::ComputedTorque);
    let mut samples = RandomVectors::new(42);
    let mut saturated = 0;
    for _ in 0..2000 {
        let [angular, linear] = [LIMITS.orientation.acceleration, LIMITS.position.acceleration];
        let desired = Acceleration { angular: samples.vector(angular), linear: samples.vector(linear) };
        let scale = 10.0_f64.powf(2.0 * samples.uniform() - 1.0);
        let added =
            Acceleration { angular: samples.vector(angular * scale), linear: samples.vector(linear * scale) };
        let mut bound = FeedbackLimiter::default();
        let limited = bound.limit(&cycle(&constants), &desired, &CommandedAcceleration(added.vector())).0;
        let got = Acceleration::from_vector(&limited);
        let mut is_saturated = false;
        for (desired, added, got, limit) in [
            (desired.angular, added.angular, got.angular, angular),
            (desired.linear, added.linear, got.linear, linear),
        ] {
            let within = |share: f64| (desired + added * share).norm() <= 1.5 * limit;
            let share = if within(1.0) { 1.0 } else { bisected(0.0, 1.0, within) };
            is_saturated |= share < 1.0;
            assert!((got - added * share).norm() <= 1e-9 * (1.0 + added.norm()), "{share}");
        }
        assert_eq!(limited != added.vector(), is_saturated);
        saturated += u32::from(is_saturated);
    }
    assert!((500..1500).contains(&saturated), "{saturated}");
}

#[test]
fn feedback_on_legs_is_scaled_by_the_leg_that_exceeds_its_bound_most() {
    let constants = constants(ControlMode::JointPd);
    let acceleration = LIMITS.position.acceleration + constants.arm_m * LIMITS.orientation.acceleration;
    let bounds = Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0).map(|saturation| 1.5 * acceleration + saturation);
    for leg in 0..LEGS {
        for (ratio, is_saturated) in [(0.999, false), (-0.999, false), (1.001, true), (-4.0, true)] {
            let mut wanted = bounds * 0.3;
            wanted[leg] = ratio * bounds[leg];
            let mut bound = FeedbackLimiter::default();
            let commanded = CommandedAcceleration(wanted);
            let got = bound.limit(&cycle(&constants), &Acceleration::default(), &commanded).0;
            let expected = if is_saturated { wanted / ratio.abs() } else { wanted };
            assert!((got - expected).norm() < 1e-12 && (got != wanted) == is_saturated);
        }
    }
}

/// Saturation may last a tenth of a second. Cycles without saturation reduce its time at 3 % of the speed.
#[test]
fn saturation_that_lasts_is_a_fault() {
    let constants = constants(ControlMode::ComputedTorque);
    let run = |pattern: &dyn Fn(u32) -> bool, cycles: u32| {
        let mut bound = FeedbackLimiter::default();
        (0..cycles).find(|k| {
            let wanted = if pattern(*k) { Vector6::repeat(1e3) } else { Vector6::zeros() };
            bound.limit(&cycle(&constants), &Acceleration::default(), &CommandedAcceleration(wanted));
            bound.check_saturation_time().is_err()
        })
    };
    // The period is 1 ms: the fault comes in the first cycle beyond 100 ms, or in the one before by the
    // rounding of sums.
    assert!(matches!(run(&|_| true, 1000), Some(99 | 100)), "{:?}", run(&|_| true, 1000));
    assert_eq!(run(&|k| k < 95, 1000), None);
    // 90 ms of saturation, 200 ms that reduce the time by 6 ms, then at least 16 ms until the fault.
    let found = run(&|k| !(90..290).contains(&k), 1000);
    assert!(matches!(found, Some(305..=307)), "{found:?}");
    // One saturated cycle in 20 adds more than is forgotten, one in 50 adds less.
    assert!(run(&|k| k % 20 == 0, 20_000).is_some() && run(&|k| k % 50 == 0, 20_000).is_none());
}

/// Every mode, every leg, every kind of number that is not finite.
#[test]
fn a_force_that_is_not_finite_is_refused() {
    for mode in ControlMode::ALL {
        let constants = constants(mode);
        let motion = TaskState::at_rest(constants.machine().home).motion();
        let with =
            |motion: &Motion, acceleration| forces(&constants, motion, &CommandedAcceleration(acceleration));
        assert!(with(&motion, Vector6::zeros()).is_ok(), "{mode:?}");
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for k in 0..6 {
                let (mut acceleration, mut moved) = (Vector6::zeros(), motion);
                acceleration[k] = number;
                moved.acceleration.linear[k % 3] = number;
                let found = if mode.acts_on_legs() {
                    with(&motion, acceleration)
                } else {
                    with(&moved, Vector6::zeros())
                };
                assert_eq!(found, Err(DiagnosticCode::ForceNotFinite.into()), "{mode:?}: {number} in {k}");
            }
        }
    }
}
