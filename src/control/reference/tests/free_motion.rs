//! Motion of a platform without force: what of its measurements counts, and how its deceleration leads on.

use super::super::target::at_rest;
use super::*;
use crate::control::controller::{Cycle, Measurement};
use crate::control::free_motion::FreeMotion;
use crate::control::localization::{Located, PlatformState};
use crate::control::state::State;
use crate::model::rigid::{Motion, Twist};

const MS: u64 = 1_000_000;

fn constants() -> Constants {
    let machine = machine(&mut Samples::new(72));
    Constants::new(&machine, Parameters { force_delay_ns: 2 * MS, ..parameters(&machine) })
}

/// The motion found in a cycle at `release_ns`, from a measurement of a speed along x, if there is one.
fn update(
    free: &mut FreeMotion,
    constants: &Constants,
    (release_ns, state): (u64, State),
    measured: Option<(u64, f64)>,
) -> Option<Motion> {
    let (time_ns, speed) = measured.unwrap_or_default();
    let measurement = Measurement { time_ns, ..Measurement::default() };
    let twist = Twist { linear: Vector3::x() * speed, ..Twist::default() };
    let pose = *constants.home.pose();
    let platform = PlatformState { pose, twist, condition: 2.0, time_to_singularity: f64::INFINITY };
    let located = Located { measurement: &measurement, rate: [0.0; LEGS], platform };
    let cycle = Cycle { constants, release_ns, state };
    free.update(&cycle, measured.map(|_| &located))
}

#[test]
fn two_measurements_without_force_give_the_deceleration() {
    let constants = constants();
    let home = at_rest(constants.home.pose());
    // From 1 m/s by 20 m/s^2; the force begins 2 ms after the release.
    for (age_ms, is_at_rest) in [(1, false), (4, false), (60, true)] {
        let mut free = FreeMotion::default();
        assert!(update(&mut free, &constants, (10 * MS, State::Standby), Some((10 * MS, 1.0))).is_none());
        let release = ((14 + age_ms) * MS, State::Standby);
        let found = update(&mut free, &constants, release, Some((14 * MS, 0.92))).unwrap();
        let t = (age_ms + 2) as f64 * 1e-3;
        let speed = if is_at_rest { 0.0 } else { 0.92 - 20.0 * t };
        let way = if is_at_rest { 0.92 * 0.92 / 40.0 } else { 0.5 * (0.92 + speed) * t };
        assert!((found.twist.linear - Vector3::x() * speed).norm() < 1e-9, "{:?}", found.twist);
        assert!((found.pose.position - home.pose.position - Vector3::x() * way).norm() < 1e-9);
    }
}

/// From 0.5 m/s, in periods of 1 ms: a tenth of the velocity limit in each, or a little more.
#[test]
fn control_begins_after_hard_brakes_and_not_under_them() {
    let mut constants = constants();
    (constants.parameters.period_ns, constants.parameters.limits.position.velocity) = (MS, 1.0);
    for (deceleration, is_known) in [(99.0, true), (101.0, false)] {
        let mut free = FreeMotion::default();
        let mut at = |ms: u64, speed: f64| {
            update(&mut free, &constants, ((20 + ms) * MS, State::Standby), Some(((20 + ms) * MS, speed)))
        };
        assert!(at(0, 0.5).is_none());
        assert_eq!(at(1, 0.5 - 1e-3 * deceleration).is_some(), is_known, "{deceleration}");
        // At rest before the force begins 2 ms later.
        assert!(at(4, 0.5 - 4e-3 * deceleration).is_some_and(|motion| motion.twist.linear.norm() < 1e-12));
        assert!(at(10, 0.0).is_some());
    }
}

#[test]
fn a_measurement_counts_once_and_only_if_no_force_acted_when_it_was_taken() {
    let constants = constants();
    let standby = |ms: u64| (ms * MS, State::Standby);
    // The same measurement again is no second one; nor is an older one.
    let mut free = FreeMotion::default();
    for again_ms in [10, 10, 9] {
        let found = update(&mut free, &constants, standby(12), Some((again_ms * MS, 1.0)));
        assert!(found.is_none(), "{again_ms}");
    }
    assert!(update(&mut free, &constants, standby(12), Some((11 * MS, 0.9))).is_some());
    // A gap begins anew.
    assert!(update(&mut free, &constants, standby(13), None).is_none());
    assert!(update(&mut free, &constants, standby(14), Some((14 * MS, 0.9))).is_none());
    // The force of the last cycle under control is held until 3 ms after its release.
    let mut free = FreeMotion::default();
    assert!(update(&mut free, &constants, (20 * MS, State::Active), Some((20 * MS, 1.0))).is_none());
    for ms in [21, 22] {
        assert!(update(&mut free, &constants, standby(ms), Some((ms * MS, 1.0))).is_none());
    }
    assert!(update(&mut free, &constants, standby(23), Some((23 * MS, 0.9))).is_none(), "the first");
    assert!(update(&mut free, &constants, standby(24), Some((24 * MS, 0.8))).is_some(), "the second");
    // Control forgets what came before it.
    assert!(update(&mut free, &constants, (25 * MS, State::Active), Some((25 * MS, 0.8))).is_none());
    assert!(update(&mut free, &constants, standby(30), Some((30 * MS, 0.8))).is_none());
    // A platform that stands needs one.
    let mut free = FreeMotion::default();
    let standing = 1e-3 * LIMITS.position.velocity;
    assert!(update(&mut free, &constants, standby(1), Some((MS, 0.99 * standing))).is_some());
    let mut free = FreeMotion::default();
    assert!(update(&mut free, &constants, standby(1), Some((MS, 1.01 * standing))).is_none());
}
