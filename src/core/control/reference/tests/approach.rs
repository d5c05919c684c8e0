//! Tests of the braking curves against their equations, and of derivatives against differences.

use crate::control::reference::proposal::approach::{
    Approach, ApproachTarget, WantedVelocity, limit_leg_rates,
};
use crate::control::reference::tests::*;

const P: DerivativeLimits = LIMITS.position;

/// `tau1` and `a` of the equations in [`crate::control::reference::proposal::approach`].
fn constants_of(scale: f64, step_s: f64) -> (f64, f64) {
    let outer_s = (0.4 * P.acceleration / P.jerk).max(4.0 * step_s);
    (outer_s, 0.95 * scale * P.acceleration)
}

/// `d(v)`: stopping distance from a velocity.
fn braking_way(v: f64, scale: f64, step_s: f64) -> f64 {
    let ((outer_s, a), jerk) = (constants_of(scale, step_s), scale * P.jerk);
    if v >= a * a / jerk {
        outer_s * v + 0.5 * v * v / a + 0.5 * v * a / jerk
    } else {
        outer_s * v + v.powf(1.5) / jerk.sqrt()
    }
}

#[test]
fn the_closing_velocity_is_the_inverse_of_the_braking_way() {
    for (scale, step_s) in [(1.0, 1e-3), (0.3, 1e-3), (1.0, 0.02), (0.05, 1e-4)] {
        let approach = Approach::new(P, scale, step_s);
        let top = scale * P.velocity;
        let (outer_s, a) = constants_of(scale, step_s);
        let corner = a * a / (scale * P.jerk);
        for k in 1..1000 {
            let v = top * f64::from(k) / 1000.0;
            let way = braking_way(v, scale, step_s);
            let (found, slope) = approach.closing_velocity_and_slope(way);
            assert!((found / v - 1.0).abs() < 1e-4, "{scale} {step_s}: {found}, not {v}");
            if (v - corner).abs() > 1e-3 * top {
                let [after, before] =
                    [1.0, -1.0].map(|sign| approach.closing_velocity_and_slope(way * (1.0 + sign * 1e-6)).0);
                let difference = (after - before) / (2e-6 * way);
                assert!((slope / difference - 1.0).abs() < 1e-3, "{scale} {v}: {slope}, not {difference}");
            }
        }
        assert_eq!(approach.closing_velocity_and_slope(2.0 * braking_way(top, scale, step_s)), (top, 0.0));
        assert!((approach.closing_slope_at_target() * outer_s - 1.0).abs() < 1e-12);
    }
}

/// Also on the sphere of the velocity limit, where the velocity can only turn.
#[test]
fn the_derivative_of_the_wanted_velocity_is_that_of_its_differences() {
    let mut samples = RandomVectors::new(51);
    let mut limited = 0;
    for _ in 0..2000 {
        let (approach, other) = (Approach::new(P, 0.9, 1e-3), Approach::new(P, 0.4, 2e-3));
        let distance = 10.0_f64.powf(-3.0 * samples.uniform());
        let offset = samples.vector(distance);
        let [target_velocity, ahead, target_acceleration] = [0.8, 0.8, 5.0].map(|size| samples.vector(size));
        let at = |dt: f64| {
            let offset = offset + (target_velocity - ahead) * dt + target_acceleration * (0.5 * dt * dt);
            let target = ApproachTarget {
                offset,
                target_velocity: target_velocity + target_acceleration * dt,
                target_acceleration,
            };
            // The target of the other vector does not matter.
            let beside = ApproachTarget { offset: 3.0 * offset, ..target };
            let both = Pair { angular: &ahead, linear: &ahead };
            let approaches = Pair { angular: &approach, linear: &other };
            let wanted =
                Approach::wanted(approaches, Pair { angular: &target, linear: &beside }, both).angular;
            let approaches = Pair { angular: &other, linear: &approach };
            let second =
                Approach::wanted(approaches, Pair { angular: &beside, linear: &target }, both).linear;
            assert_eq!((wanted.velocity, wanted.derivative), (second.velocity, second.derivative));
            wanted
        };
        if distance < 1e-3 || offset.norm() < 1e-3 {
            continue;
        }
        let (now, dt) = (at(0.0), 1e-7);
        let [after, before] = [at(dt), at(-dt)];
        if [after.is_limited, before.is_limited] != [now.is_limited; 2] {
            continue;
        }
        let difference = (after.velocity - before.velocity) / (2.0 * dt);
        let scale = 1.0 + difference.norm();
        assert!((now.derivative - difference).norm() < 1e-3 * scale, "{now:?}, not {difference}");
        assert!(now.velocity.norm() <= 0.999 * P.velocity * (1.0 + 1e-12));
        assert!(!now.is_limited || (now.velocity.norm() - 0.999 * P.velocity).abs() < 1e-12);
        limited += u32::from(now.is_limited);
    }
    assert!((100..1500).contains(&limited), "{limited}");
}

/// The acceleration follows the curve of the last equation. Its magnitude and its change are limited.
#[test]
fn the_acceleration_follows_the_inner_curve_and_keeps_both_limits() {
    let mut samples = RandomVectors::new(52);
    let step_s = 1e-3;
    let approach = Approach::new(P, 1.0, step_s);
    let time = 0.5 * constants_of(1.0, step_s).0;
    let mut seen = [0; 3];
    for _ in 0..2000 {
        let wanted = WantedVelocity {
            velocity: samples.vector(0.3),
            derivative: samples.vector(6.0),
            is_limited: false,
        };
        let ahead = wanted.velocity - samples.vector(0.1);
        let x = wanted.velocity - ahead;
        let scale = 0.7 * P.jerk * time * time;
        let free = wanted.derivative + x * (2.0 / (time * (1.0 + (1.0 + 2.0 * x.norm() / scale).sqrt())));
        let aim = free * (P.acceleration / free.norm()).min(1.0);
        let near = aim + samples.vector(0.9 * P.jerk * step_s);
        let present = if samples.below(2) == 0 { near } else { samples.vector(P.acceleration) };
        let still = Vector3::zeros();
        let none = WantedVelocity { velocity: still, derivative: still, is_limited: false };
        let (Pair { angular: found, linear: other }, limits) = Approach::accelerations(
            Pair { angular: &approach, linear: &approach },
            Pair { angular: &wanted, linear: &none },
            Pair { angular: &ahead, linear: &still },
            Pair { angular: &present, linear: &still },
            false,
        );
        assert_eq!(other, still);
        let change = aim - present;
        let expected = present + change * (P.jerk * step_s / change.norm()).min(1.0);
        assert!((found - expected).norm() < 1e-9, "{found}, not {expected}");
        let is_limited = [free.norm() > P.acceleration, change.norm() > P.jerk * step_s];
        let expected =
            LimitSet::default().with(Limit::Acceleration, is_limited[0]).with(Limit::Jerk, is_limited[1]);
        assert_eq!(limits, expected);
        let kinds = [is_limited[0], is_limited[1], is_limited == [false; 2]];
        seen = core::array::from_fn(|kind| seen[kind] + u32::from(kinds[kind]));
    }
    assert!(seen.iter().all(|count| *count > 100), "{seen:?}");
}

/// Both vectors start at rest without acceleration, and their changes are limited. The first change has the
/// direction of both wanted accelerations.
#[test]
fn accelerations_in_proportion_keep_their_direction() {
    let mut samples = RandomVectors::new(54);
    let (step_s, still) = (1e-3, Vector3::zeros());
    let approaches = [Approach::new(P, 1.0, step_s), Approach::new(P.scaled(0.5), 1.0, step_s)];
    let approaches = Pair { angular: &approaches[0], linear: &approaches[1] };
    let at_rest = Pair { angular: &still, linear: &still };
    let mut turned = 0;
    for _ in 0..500 {
        let mut wanted =
            || WantedVelocity { velocity: still, derivative: samples.vector(20.0), is_limited: false };
        let [turn, shift] = [wanted(), wanted()];
        let of = |in_proportion| {
            let wanted = Pair { angular: &turn, linear: &shift };
            let (Pair { angular, linear }, _) =
                Approach::accelerations(approaches, wanted, at_rest, at_rest, in_proportion);
            [angular, linear]
        };
        let [found, separate] = [of(true), of(false)];
        let limits = [P.jerk * step_s, 0.5 * P.jerk * step_s];
        let ratio = (limits[0] / turn.derivative.norm()).min(limits[1] / shift.derivative.norm()).min(1.0);
        assert!((found[0] - turn.derivative * ratio).norm() < 1e-9);
        assert!((found[1] - shift.derivative * ratio).norm() < 1e-9);
        turned += u32::from((separate[0] - found[0]).norm() + (separate[1] - found[1]).norm() > 1e-3);
    }
    assert!(turned > 100, "{turned}");
}

#[test]
fn wanted_velocities_are_reduced_by_one_factor_until_no_leg_moves_too_fast() {
    let mut samples = RandomVectors::new(53);
    let machine = machine(&mut samples);
    let constants = Constants::new(&machine, parameters(&machine));
    let limit = 0.97 * machine.actuator.max_rate_m_s;
    let mut reduced = 0;
    for _ in 0..500 {
        let pose = pose(&mut samples, &constants);
        let mut wanted = || WantedVelocity {
            velocity: samples.vector(1.5),
            derivative: samples.vector(3.0),
            is_limited: false,
        };
        let [turn, shift] = [wanted(), wanted()];
        let fastest = |turn: &WantedVelocity, shift: &WantedVelocity| {
            let twist = Twist { angular: turn.velocity, linear: shift.velocity };
            let (_, rates) = leg_lengths_and_rates(&machine, &pose, &twist);
            rates.iter().fold(0.0_f64, |fastest, rate| fastest.max(rate.abs()))
        };
        let before = fastest(&turn, &shift);
        let (mut new_turn, mut new_shift) = (turn, shift);
        let is_reduced = limit_leg_rates(&constants, &pose, &mut new_turn, &mut new_shift);
        assert_eq!(is_reduced, before > limit);
        let factor = (limit / before).min(1.0);
        for (new, old) in [(new_turn, turn), (new_shift, shift)] {
            assert!((new.velocity - old.velocity * factor).norm() < 1e-12);
            assert!((new.derivative - old.derivative * factor).norm() < 1e-12);
        }
        reduced += u32::from(is_reduced);
    }
    assert!((50..450).contains(&reduced), "{reduced}");
}
