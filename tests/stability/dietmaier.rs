//! Dietmaier's platform: all forty solutions of its lengths are real (Dietmaier 1998, The Stewart-Gough platform
//! of general geometry can have 40 real postures).

use std::f64::consts::PI;

use hexad::analysis::assembly_proof::{Modes, all_modes};

use super::*;

const LENGTHS: [f64; 6] = [1.0, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071];

fn dietmaier() -> Machine {
    let mut dietmaier = machine("tsai2000");
    let legs = Legs {
        base: [
            [0.0, 0.0, 0.0],
            [1.107915, 0.0, 0.0],
            [0.549094, 0.756063, 0.0],
            [0.735077, -0.223935, 0.525991],
            [0.514188, -0.526063, -0.368418],
            [0.590473, 0.094733, -0.205018],
        ]
        .map(Vector3::from),
        platform: [
            [0.0, 0.0, 0.0],
            [0.542805, 0.0, 0.0],
            [0.956919, -0.528915, 0.0],
            [0.665885, -0.353482, 1.402538],
            [0.478359, 1.158742, 0.107672],
            [-0.137087, -0.235121, 0.353913],
        ]
        .map(Vector3::from),
        universal_axis: [Vector3::y(); 6],
    };
    dietmaier.home = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    dietmaier.joints = legs.joints(&dietmaier.home);
    dietmaier
}

static MODES: LazyLock<Modes> = LazyLock::new(|| all_modes(&dietmaier(), &LENGTHS, &Matrix3::identity(), PI));

#[test]
fn all_forty_are_found() {
    let dietmaier = dietmaier();
    assert_eq!(MODES.poses.len(), 40);
    for mode in &MODES.poses {
        let lengths = leg_lengths(&dietmaier, mode.pose());
        assert!(lengths.iter().zip(&LENGTHS).all(|(a, b)| (a - b).abs() < 1e-12), "{lengths:?}");
    }
    let positive = MODES.poses.iter().filter(|mode| mode.sensitivity().determinant > 0.0).count();
    // Solutions are born and die in pairs of opposite sign.
    assert_eq!(positive, 20);
}

/// Three trusted steps around, on every mode but those that are singular for all practical purposes: there
/// nothing is trusted.
#[test]
fn small_motions_stay_on_their_mode() {
    let dietmaier = dietmaier();
    let mut singular = 0;
    for (k, mode) in MODES.poses.iter().enumerate() {
        let sensitivity = mode.sensitivity();
        let size = sensitivity.trusted_step * 3.0;
        if sensitivity.condition > MAX_CONDITION {
            let mut tracker = Tracker::new(&dietmaier, *mode.pose());
            assert_eq!(tracker.find(&dietmaier, &LENGTHS).0, TrackingResult::NotConverged, "mode {k}");
            assert_eq!(tracker.outcome(), Outcome::NearSingular, "mode {k}");
            singular += 1;
            continue;
        }
        let mut tracker = Tracker::new(&dietmaier, *mode.pose());
        for step in 0..=200 {
            let phase = f64::from(step) * PI / 50.0;
            let (a, b) = (phase.sin() * size, (1.0 - phase.cos()) * 0.5 * size);
            let shift = Vector3::new(b, -a, a) * dietmaier.joints.radius_m;
            let there = mode.pose().displaced(&Twist { angular: Vector3::new(a, b, -b), linear: shift });
            let lengths = leg_lengths(&dietmaier, &there);
            assert_eq!(tracker.find(&dietmaier, &lengths).0, TrackingResult::Found, "mode {k}");
            assert!(dietmaier.joints.distance(tracker.pose(), &there) < 1e-9, "mode {k}, step {step}");
        }
    }
    assert_eq!(singular, 5);
}
