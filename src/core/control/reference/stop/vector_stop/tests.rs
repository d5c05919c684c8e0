use fearless_simd::{Level, dispatch};

use crate::control::reference::stop::pose_stop::StopKind;
use crate::control::reference::stop::vector_stop::*;
use crate::control::tests::random_vectors::RandomVectors;

const LIMITS: [DerivativeLimits; 5] = [
    DerivativeLimits { velocity: 1.0, acceleration: 5.0, jerk: 500.0 },
    DerivativeLimits { velocity: 2.0, acceleration: 20.0, jerk: 2000.0 },
    DerivativeLimits { velocity: 1.0, acceleration: 5.0, jerk: 50.0 },
    DerivativeLimits { velocity: 0.2, acceleration: 8.0, jerk: 300.0 },
    DerivativeLimits { velocity: 0.01, acceleration: 1e-3, jerk: 1e-4 },
];

/// A velocity and an acceleration within the limits: in any direction, often at the limits or aligned.
fn start(samples: &mut RandomVectors, limits: &DerivativeLimits) -> [Vector3<f64>; 2] {
    let v = samples.vector(limits.velocity);
    let a = match samples.below(4) {
        0 => v * (-limits.acceleration / v.norm().max(1e-30) * samples.uniform()),
        _ => samples.vector(limits.acceleration),
    };
    [v, a]
}

/// Stop that is planned in the memory of a longer one.
fn planned(kind: StopKind, v: &Vector3<f64>, a: &Vector3<f64>, limits: &DerivativeLimits) -> Stop {
    let mut stop =
        Stop { count: 9, begins: [0.0; MAX_PIECES], peak_velocity: 9.0, duration_s: 9.0, ..Stop::default() };
    dispatch!(Level::new(), simd => match kind {
        StopKind::ReleaseFirst => stop.release_first(simd, v, a, limits),
        StopKind::BrakeAtOnce => stop.brake_at_once(simd, v, a, limits),
    });
    stop
}

fn norm(lanes: Padded) -> f64 {
    nalgebra::Vector4::from(lanes).norm()
}

fn state(stop: &Stop, t: f64) -> VectorStopState {
    dispatch!(Level::new(), simd => stop.at(simd, t))
}

#[test]
fn a_stop_keeps_acceleration_jerk_and_its_peak_velocity_and_ends_at_rest() {
    let mut samples = RandomVectors::new(1);
    let mut worst = [0.0_f64; 4];
    for limits in LIMITS {
        for _ in 0..20_000 {
            let [v, a] = start(&mut samples, &limits);
            for kind in [StopKind::ReleaseFirst, StopKind::BrakeAtOnce] {
                let stop = planned(kind, &v, &a, &limits);
                let first = state(&stop, 0.0);
                assert!((first.velocity - v).norm() <= 1e-12 && (first.acceleration - a).norm() <= 1e-12);
                let last = stop.begins[stop.count - 1];
                assert_eq!(last, stop.duration_s);
                let before = state(&stop, stop.duration_s * (1.0 - 1e-12));
                let mut check = |k: usize, ratio: f64| worst[k] = worst[k].max(ratio);
                check(0, before.velocity.norm() / limits.velocity);
                for k in 0..=40 {
                    let state = state(&stop, stop.duration_s * f64::from(k) / 40.0);
                    check(1, state.acceleration.norm() / limits.acceleration);
                    check(2, state.velocity.norm() - stop.peak_velocity * (1.0 + 1e-9));
                }
                for piece in &stop.pieces[..stop.count - 1] {
                    check(1, norm(piece.acceleration) / limits.acceleration);
                    check(2, norm(piece.velocity) - stop.peak_velocity * (1.0 + 1e-9));
                    check(3, norm(piece.jerk) / limits.jerk);
                }
            }
        }
    }
    let [at_end, acceleration, velocity, jerk] = worst;
    assert!(at_end < 1e-6 && velocity <= 1e-9, "{at_end} {velocity}");
    assert!((1.0..1.0 + 1e-9).contains(&acceleration.max(1.0)) && jerk < 1.0 + 1e-9, "{acceleration} {jerk}");
    assert!(acceleration > 0.99 && jerk > 0.99, "the limits are used: {acceleration} {jerk}");
}

#[test]
fn the_extent_bounds_the_stop_that_releases_first() {
    let mut samples = RandomVectors::new(2);
    let mut largest_use: f64 = 0.0;
    for limits in LIMITS {
        for _ in 0..10_000 {
            let [v, a] = start(&mut samples, &limits);
            let extent = release_first_extent(&v, &a, &limits);
            let stop = planned(StopKind::ReleaseFirst, &v, &a, &limits);
            assert!((stop.duration_s - extent.duration_s).abs() <= 1e-9 * extent.duration_s);
            for k in 0..=20 {
                let state = state(&stop, stop.duration_s * f64::from(k) / 20.0);
                let used = state.displacement.norm() / extent.distance_bound.max(1e-30);
                assert!(used <= 1.0 + 1e-9 && state.velocity.norm() <= extent.peak_velocity * (1.0 + 1e-9));
                largest_use = largest_use.max(used);
            }
        }
    }
    assert!(largest_use > 0.99, "{largest_use}");
}

/// Lengths of both stops from 1 m/s, in mm.
#[test]
fn a_stop_takes_little_more_than_the_shortest_way() {
    let [limits, ..] = LIMITS;
    let v = Vector3::new(1.0, 0.0, 0.0);
    for (a, brake_at_once, release_first) in [
        ([0.0, 0.0, 0.0], 105.0, 105.0),
        ([-5.0, 0.0, 0.0], 100.0, 110.0),
        ([0.0, 5.0, 0.0], 113.0, 115.0),
        ([-3.5, 3.5, 0.0], 104.0, 111.0),
    ] {
        let end = |kind| state(&planned(kind, &v, &a.into(), &limits), 10.0).displacement.norm() * 1e3;
        let ways = [end(StopKind::BrakeAtOnce), end(StopKind::ReleaseFirst)];
        assert!((ways[0] - brake_at_once).abs() < 1.0 && (ways[1] - release_first).abs() < 1.0, "{ways:?}");
    }
}

/// The bound on the velocity combines the bounds of both parts and is no larger.
#[test]
fn the_peak_velocity_of_a_planar_stop_is_that_of_its_parts() {
    let [limits, ..] = LIMITS;
    let (v, a) = (Vector3::new(0.5, 0.0, 0.0), Vector3::new(0.0, 5.0, 0.0));
    let stop = planned(StopKind::BrakeAtOnce, &v, &a, &limits);
    // Bound across: `c^2 / 2 Jc` with `Jc = 0.8 J`.
    let across = 25.0 / (2.0 * 400.0);
    assert!((stop.peak_velocity - 0.5_f64.hypot(across)).abs() < 1e-12, "{}", stop.peak_velocity);
}
