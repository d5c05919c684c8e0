//! Tracking errors of the three deployable machines, bounded above and below: an error that shrinks for
//! no known reason is as suspicious as one that grows.

use core::f64::consts::TAU;

use hexad::control::state::State;
use hexad::model::task::TaskState;
use hexad::motion::built_in::BuiltInMotion;

use super::common::rig::{Rig, Tracking, track};
use super::common::{Errors, angle_between, deployed};

/// Length of every motion, approach and settling not counted \[s\].
const SECONDS: f64 = 8.0;

/// Expected errors may be off by a fifth either way.
const BAND: (f64, f64) = (0.8, 1.25);

/// A machine, a motion, RMS and maximum of the position error \[um\], and of the orientation error \[urad\].
type Expected = (&'static str, BuiltInMotion, [f64; 2], [f64; 2]);

/// What is left with equal parameters on both sides: the force is held over a period in which the motion
/// goes on.
const EQUAL: [Expected; 12] = [
    ("fried2008", BuiltInMotion::MinimumJerk, [1.414, 4.258], [1.484, 4.468]),
    ("fried2008", BuiltInMotion::Sines, [1.702, 4.454], [2.386, 5.844]),
    ("fried2008", BuiltInMotion::Circle, [1.194, 2.612], [0.0241, 0.0392]),
    ("fried2008", BuiltInMotion::Paper, [1.207, 2.674], [1.073, 4.724]),
    ("motion_base", BuiltInMotion::MinimumJerk, [2.822, 8.484], [1.491, 4.445]),
    ("motion_base", BuiltInMotion::Sines, [1.724, 4.527], [1.235, 2.992]),
    ("motion_base", BuiltInMotion::Circle, [2.333, 5.191], [0.0362, 0.0791]),
    ("motion_base", BuiltInMotion::Paper, [0.965, 2.150], [0.438, 1.870]),
    ("tsai2000", BuiltInMotion::MinimumJerk, [1.755, 5.266], [1.653, 4.448]),
    ("tsai2000", BuiltInMotion::Sines, [2.120, 5.457], [3.180, 6.745]),
    ("tsai2000", BuiltInMotion::Circle, [1.490, 3.235], [0.281, 0.566]),
    ("tsai2000", BuiltInMotion::Paper, [1.542, 3.449], [1.659, 5.440]),
];

/// A platform that is a fifth heavier than the controller thinks sags by the missing force over Kp.
const HEAVY: [Expected; 3] = [
    ("fried2008", BuiltInMotion::Paper, [170.7, 179.6], [4.861, 10.05]),
    ("motion_base", BuiltInMotion::Paper, [253.8, 292.7], [45.69, 62.08]),
    ("tsai2000", BuiltInMotion::Paper, [393.9, 471.4], [105.6, 166.3]),
];

fn within(found: &Errors, expected: [f64; 2], what: &str) -> bool {
    let [rms, max] = expected.map(|micro| micro * 1e-6);
    println!("    {what}: RMS {:.4}, max {:.4} millionths", found.rms() * 1e6, found.max * 1e6);
    let (low, high) = BAND;
    (low * rms..=high * rms).contains(&found.rms()) && (low * max..=high * max).contains(&found.max)
}

/// Runs a motion on a platform whose mass is `share` of the modelled one.
fn assert_tracks((name, motion, position, orientation): Expected, share: f64) -> Tracking {
    let config = deployed(name);
    let mut platform = config.machine.clone();
    platform.platform.mass *= share;
    let tracking = track(&config, &platform, motion, SECONDS);
    println!("{name} {motion:?}, {share} of the mass");
    let well = [
        within(&tracking.position, position, "position [m]"),
        within(&tracking.orientation, orientation, "orientation [rad]"),
    ];
    assert_eq!(well, [true, true], "{name} {motion:?}: {tracking:?}");
    tracking
}

#[test]
fn errors_are_what_sampling_leaves() {
    for expected in EQUAL {
        let tracking = assert_tracks(expected, 1.0);
        // The promise to users; everything above is far within it.
        assert!(tracking.position.rms() < 50e-6 && tracking.orientation.rms() < 50e-6);
    }
}

#[test]
fn a_platform_at_rest_stays_there() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let config = deployed(name);
        let tracking = track(&config, &config.machine, BuiltInMotion::Settle, SECONDS);
        assert!(tracking.position.max < 1e-11 && tracking.orientation.max < 1e-11, "{name}: {tracking:?}");
    }
}

#[test]
fn a_heavier_platform_tracks_worse_by_what_it_weighs() {
    for expected in HEAVY {
        let (name, motion, ..) = expected;
        let heavy = assert_tracks(expected, 1.2);
        let config = deployed(name);
        let equal = track(&config, &config.machine, motion, SECONDS);
        assert!(heavy.position.rms() > 50.0 * equal.position.rms(), "{name}");
    }
}

/// What the controller calls its error is the error.
#[test]
fn the_error_reported_is_the_error_made() {
    let config = deployed("fried2008");
    let mut platform = config.machine.clone();
    platform.platform.mass *= 1.2;
    let mut rig = Rig::new(&config, &platform);
    let scene = hexad::motion::built_in::fit(&config.machine, BuiltInMotion::Sines, 4.0);
    let [mut position, mut orientation] = [Errors::default(); 2];
    let tracking = rig.play(&config.machine, &scene, |_, output| {
        let error = output.error.unwrap().pose;
        position.add(error.linear.norm());
        orientation.add(error.angular.norm());
    });
    assert!((position.rms() / tracking.position.rms() - 1.0).abs() < 1e-9);
    assert!((orientation.rms() / tracking.orientation.rms() - 1.0).abs() < 1e-9);
    assert!((position.max / tracking.position.max - 1.0).abs() < 1e-9);
}

/// An offset on one axis decays as the chosen double integrator does, critically damped, and leaves the
/// other axes alone: `e = e0 (1 + wn t) exp(-wn t)`, but for the delay of the loop.
#[test]
fn an_offset_decays_as_designed() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        for axis in 0..6 {
            let mut config = deployed(name);
            config.deployment.control.orientation_bandwidth_hz = 6.0;
            let hertz = if axis < 3 { 6.0 } else { config.deployment.control.position_bandwidth_hz };
            let wn = TAU * hertz;
            let mut rig = Rig::new(&config, &config.machine);
            let offset = 2e-4 * config.machine.joints.radius.min(1.0);
            let task = TaskState::at_rest(config.machine.home);
            let wanted = task.motion().pose;
            rig.engage(&task);
            // A shove that is over before anybody sees it: too small to be called a jump.
            let mut aside = config.machine.clone();
            aside.home[axis] -= offset;
            rig.simulator = Rig::new(&config, &aside).simulator;
            for k in 0..300 {
                // The force acts from 0.6 ms after the first measurement on.
                let t = (f64::from(k) - 0.6).max(0.0) * 1e-3;
                let pose = rig.simulator.state().pose;
                let angle = angle_between(&pose.rotation, &wanted.rotation);
                let distance = (wanted.position - pose.position).norm();
                let (own, other) = if axis < 3 { (angle, distance) } else { (distance, angle) };
                let expected = offset * (1.0 + wn * t) * (-wn * t).exp();
                assert!(
                    (own - expected).abs() < 0.05 * offset,
                    "{name} axis {axis} at {t}: {own} {expected}"
                );
                assert!(other < 0.01 * offset, "{name} axis {axis} at {t}: {other}");
                let input = rig.input(&task);
                assert_eq!(rig.cycle(&input).state, State::Active);
            }
        }
    }
}
