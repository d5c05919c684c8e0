//! Tests of the motion of a platform without force: which measurements count, and how the motion continues
//! with the measured deceleration.

use crate::control::sensing::free_motion::FreeMotion;
use crate::control::tests::*;

fn constants() -> Constants {
    let machine = machine(&mut RandomVectors::new(72));
    Constants::new(&machine, Parameters { force_delay_ns: 2 * MS, ..parameters(&machine) })
}

/// Motion found in a cycle at `release_ns`. The measurement, if there is one, has a speed along x.
fn update(
    free: &mut FreeMotion,
    constants: &Constants,
    (release_ns, state): (u64, State),
    measured: Option<(u64, f64)>,
) -> Option<Motion> {
    let (time_ns, speed) = measured.unwrap_or_default();
    let measurement = Measurement { time_ns, rate_m_s: Some([0.0; LEGS]), ..Measurement::default() };
    let twist = Twist { linear: Vector3::x() * speed, ..Twist::default() };
    let pose = *constants.home.pose();
    let located = located(&measurement, pose, twist);
    let cycle = Cycle { constants, release_ns, state };
    let localization = Localization::new(constants);
    free.update(&cycle, &localization, measured.map(|_| &located)).ok()
}

#[test]
fn two_measurements_without_force_give_the_deceleration() {
    let constants = constants();
    let home = at_rest(constants.home.pose());
    // From 1 m/s, decelerating by 20 m/s^2. The force begins 2 ms after the release.
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

/// From 0.5 m/s, the velocity changes by a tenth of its limit in each period of 1 ms: just below it or just
/// above it.
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
        // The platform comes to rest before the force begins 2 ms later.
        assert!(at(4, 0.5 - 4e-3 * deceleration).is_some_and(|motion| motion.twist.linear.norm() < 1e-12));
        assert!(at(10, 0.0).is_some());
    }
}

#[test]
fn a_measurement_counts_once_and_only_if_no_force_acted_when_it_was_taken() {
    let constants = constants();
    let standby = |ms: u64| (ms * MS, State::Standby);
    // A repeated measurement is not a second one, and neither is an older one.
    let mut free = FreeMotion::default();
    for again_ms in [10, 10, 9] {
        let found = update(&mut free, &constants, standby(12), Some((again_ms * MS, 1.0)));
        assert!(found.is_none(), "{again_ms}");
    }
    assert!(update(&mut free, &constants, standby(12), Some((11 * MS, 0.9))).is_some());
    // After a gap two measurements are needed again.
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
    // Control discards the measurements before it.
    assert!(update(&mut free, &constants, (25 * MS, State::Active), Some((25 * MS, 0.8))).is_none());
    assert!(update(&mut free, &constants, standby(30), Some((30 * MS, 0.8))).is_none());
    // A platform at rest needs one measurement.
    let mut free = FreeMotion::default();
    let standing = 1e-3 * LIMITS.position.velocity;
    assert!(update(&mut free, &constants, standby(1), Some((MS, 0.99 * standing))).is_some());
    let mut free = FreeMotion::default();
    assert!(update(&mut free, &constants, standby(1), Some((MS, 1.01 * standing))).is_none());
}

/// Results of measurements without rates, one per millisecond. Each leg is longer than at home by `away(ms)`.
fn by_lengths(away: impl Fn(u64) -> f64, milliseconds: u64) -> Vec<Result<Motion, Diagnostic>> {
    let constants = constants();
    let localization = Localization::new(&constants);
    let home = constants.home.lengths(constants.machine());
    let mut free = FreeMotion::default();
    let of = |ms: u64| {
        let length_m = home.map(|length| length + away(ms));
        let measurement = Measurement { time_ns: ms * MS, length_m, ..Measurement::default() };
        // The twist from the filter of rates must not be used.
        let twist = Twist { linear: Vector3::x(), ..Twist::default() };
        let pose = *constants.home.pose();
        let located = located(&measurement, pose, twist);
        let cycle = Cycle { constants: &constants, release_ns: ms * MS, state: State::Standby };
        free.update(&cycle, &localization, Some(&located))
    };
    (1..=milliseconds).map(of).collect()
}

#[test]
fn without_rates_control_begins_at_rest_only() {
    let first = |found: &[Result<Motion, Diagnostic>]| found.iter().position(Result::is_ok);
    // In whole windows of 45 ms.
    assert_eq!(first(&by_lengths(|_| 0.0, 200)), Some(45));
    // Brakes decelerate by 10 m/s^2 from 0.3 m/s; the platform comes to rest after 30 ms.
    let braking = |ms: u64| {
        let t = ms.min(30) as f64 * 1e-3;
        (0.3 - 5.0 * t) * t
    };
    assert_eq!(first(&by_lengths(braking, 200)), Some(90));
    // A slow motion, and a motion that begins again. The next measurement beyond the scatter shows it.
    let slow = by_lengths(|ms| 5e-6 * ms as f64, 200);
    assert_eq!(first(&slow), None);
    let Err(found) = slow[150] else { panic!("it moves") };
    let standing = 1e-3 * LIMITS.position.velocity;
    assert_eq!((found.code, found.bound), (DiagnosticCode::RestNotShown, standing));
    assert!((0.003..0.05).contains(&found.value), "{}", found.value);
    let again = by_lengths(|ms| if ms < 100 { 0.0 } else { 1e-4 * (ms - 99) as f64 }, 130);
    assert!(again[98].is_ok() && again[99..].iter().all(Result::is_err));
}

/// The lengths have noise of 2 um, which the machine file does not state.
#[test]
fn a_platform_at_rest_with_noise_is_accepted_in_time() {
    let mut samples = RandomVectors::new(37);
    let mut normal = || (0..12).map(|_| samples.uniform()).sum::<f64>() - 6.0;
    let (mut in_time, trials) = (0, 1000);
    for _ in 0..trials {
        let noise: Vec<f64> = (0..101).map(|_| 2e-6 * normal()).collect();
        in_time += u32::from(by_lengths(|ms| noise[ms as usize], 100)[99].is_ok());
    }
    assert!(f64::from(in_time) >= 0.99 * f64::from(trials), "{in_time}");
}
