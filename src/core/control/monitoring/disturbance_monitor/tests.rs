//! Errors that swing, payload changes and impacts are detected; a ringing error and a constant payload are
//! not.

use core::f64::consts::TAU;

use nalgebra::Matrix6;

use crate::control::monitoring::disturbance_monitor::*;
use crate::model::task::TaskState;

const ZERO: Matrix6<f64> = Matrix6::from_array_storage(nalgebra::ArrayStorage([[0.0; 6]; 6]));
const NO_FRICTION: FrictionEffects = FrictionEffects {
    force_n: 0.0,
    payload_kg_per_n: [0.0; 6],
    swing_acceleration_m_s2_per_n: [0.0; 6],
    by_force: ZERO,
    force_by_disturbance: ZERO,
};

const BOUNDS: DisturbanceBounds = DisturbanceBounds {
    payload_by_disturbance: Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.2),
    payload_by_norm: 0.2,
    gravity_over_square: Vector3::new(0.0, 0.0, -1.0 / 9.81),
    max_payload_change_kg: 0.1,
    max_sudden_acceleration_m_s2: 2.0,
    swing: MIN_SWING_PEAK_TO_PEAK_M,
    swing_by_acceleration: 1.0 / SWING_STIFFNESS,
    swing_by_friction: 1.0 / SWING_STIFFNESS,
    max_reversal_interval_s: 0.1,
    arm_squared: 1.0,
    friction: NO_FRICTION,
};

fn along_z(value: f64) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, value)
}

/// First diagnostic and its time. `at` gives the estimate, the reference acceleration and the sudden
/// disturbance.
fn found(at: impl Fn(f64) -> (ErrorEstimate, f64, f64)) -> Option<(DiagnosticCode, f64)> {
    let mut monitor = DisturbanceMonitor::default();
    (0..4000).map(|cycle| 1e-3 * f64::from(cycle)).find_map(|t| {
        let (estimate, acceleration, sudden) = at(t);
        checked(&mut monitor, &estimate, acceleration, sudden).map(|code| (code, t))
    })
}

/// The code that a monitor finds in a cycle.
fn checked(
    monitor: &mut DisturbanceMonitor,
    estimate: &ErrorEstimate,
    acceleration: f64,
    sudden: f64,
) -> Option<DiagnosticCode> {
    let mut reference = TaskState::at_rest([0.0; 6]).motion();
    reference.acceleration.linear.z = acceleration;
    let sudden = (&along_z(sudden), &UnstatedFriction::default());
    monitor.check(&BOUNDS, estimate, &reference, sudden, 1e-3).err().map(|found| found.code)
}

fn with(error: f64, disturbance: f64) -> ErrorEstimate {
    ErrorEstimate {
        value: along_z(error),
        rate: Vector6::zeros(),
        disturbance_acceleration: along_z(disturbance),
    }
}

#[test]
fn an_error_that_swings_is_named() {
    let swinging = |metres: f64, hertz: f64, acceleration: f64| {
        found(|t| {
            let phase = (hertz * TAU * t).sin();
            (with(1e-3 + metres * phase, 0.0), acceleration * phase, 0.0)
        })
    };
    for hertz in [7.0, 10.0, 30.0, 100.0] {
        let (code, after_s) = swinging(5e-5, hertz, 0.0).unwrap();
        assert_eq!(code, DiagnosticCode::Oscillation);
        // A second after control began, or four periods later.
        assert!(after_s < START_S + 4.0 / hertz, "{hertz} Hz: {after_s} s");
        assert_eq!(swinging(3.5e-5, hertz, 0.0), None, "{hertz} Hz");
    }
    // No fault: an inexactly followed slow motion, and a reference that shakes as well.
    assert_eq!(swinging(1e-3, 2.0, 0.0), None);
    assert_eq!(swinging(2e-4, 8.0, 4.0), None);
}

/// End of a disturbance at 1.5 s: each swing is the previous one times `ratio`.
#[test]
fn an_error_that_rings_until_it_is_at_rest_is_none() {
    let ringing = |ratio: f64| {
        found(|t| {
            let swings = 20.0 * (t - 1.5);
            let size = if swings < 0.0 { 0.0 } else { 4e-4 * ratio.powf(swings) };
            (with(size * (0.5 * TAU * swings).sin(), 0.0), 0.0, 0.0)
        })
    };
    assert_eq!(ringing(0.8), None);
    assert_eq!(ringing(0.95).map(|(code, _)| code), Some(DiagnosticCode::Oscillation));
}

#[test]
fn a_payload_that_changes_is_named_and_one_that_stays_is_not() {
    let carried = |ratio: f64, from_s: f64, lift: f64| {
        let load = move |t: f64| if t < from_s { 0.0 } else { ratio };
        found(|t| {
            let acceleration = lift * (TAU * t).sin();
            (with(0.0, load(t) / 0.2 * (1.0 + acceleration / 9.81)), acceleration, 0.0)
        })
    };
    for ratio in [0.2, -0.2] {
        let (code, at_s) = carried(ratio, 2.0, 0.0).unwrap();
        assert_eq!(code, DiagnosticCode::PayloadChanged);
        assert!((2.015..2.03).contains(&at_s), "{ratio}: {at_s}");
        assert_eq!(carried(ratio, 0.0, 4.0), None, "{ratio}");
        assert_eq!(carried(0.4 * ratio, 2.0, 4.0), None, "{ratio}");
    }
}

#[test]
fn an_impact_is_brief() {
    let pushed =
        |sudden: f64| found(|t| (ErrorEstimate::default(), 0.0, if t >= 1.0 { sudden } else { 0.0 }));
    assert_eq!(pushed(1.9), None);
    assert_eq!(pushed(2.1), Some((DiagnosticCode::Impact, 1.0)));
    let mut monitor = DisturbanceMonitor::default();
    let lasting = |_| {
        monitor
            .check_impact(&BOUNDS, &along_z(4.1f64.sqrt()), &UnstatedFriction::default(), 1e-3)
            .err()
            .map(|found| found.code)
    };
    let codes: [_; 25] = core::array::from_fn(lasting);
    assert_eq!(codes[15], Some(DiagnosticCode::Impact));
    assert_eq!(codes[24], Some(DiagnosticCode::DisturbanceLasting));
}

#[test]
fn what_limits_took_away_is_no_change() {
    let changed = |limited: f64, disturbance: f64| {
        let mut monitor = DisturbanceMonitor::default();
        (0..2000).find_map(|cycle| {
            let is_cut = cycle >= 1500;
            if is_cut {
                monitor.record_removed_acceleration(&BOUNDS, &FeedbackAcceleration(along_z(limited)));
            }
            let disturbance = if is_cut { disturbance } else { 0.0 };
            checked(&mut monitor, &with(0.0, disturbance), 0.0, disturbance)
        })
    };
    assert_eq!(changed(0.0, 1.0), Some(DiagnosticCode::PayloadChanged));
    assert_eq!(changed(1.0, 1.0), None);
    assert_eq!(changed(2.0, 2.4), None);
    assert_eq!(changed(2.0, 4.1), Some(DiagnosticCode::Impact));
    // Forgotten after some seconds.
    let mut monitor = DisturbanceMonitor::default();
    monitor.record_removed_acceleration(&BOUNDS, &FeedbackAcceleration(along_z(1e3)));
    assert_eq!(monitor.removed_acceleration, 1e3);
    assert!((0..12_000).all(|_| checked(&mut monitor, &with(0.0, 0.0), 0.0, 0.0).is_none()));
    assert!(monitor.removed_acceleration < 0.01, "{}", monitor.removed_acceleration);
}
