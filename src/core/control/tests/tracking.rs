//! Tests of the errors under control: a measurement far from the prediction is not trusted, and a measurement
//! that is not new changes no error.

use crate::control::tests::*;
use crate::model::inverse_jacobian::leg_wrenches;

/// Error after updates of a tracker that began at 0. Each update has a time stamp \[ms\] and a displacement
/// from home.
fn updated(constants: &Constants, tracker: &mut ErrorTracker, measured: &[(u64, Twist)]) -> PoseError {
    let home = *constants.home.pose();
    let mut reference = ReferenceGenerator::new(constants);
    reference.verify_start(constants, &at_rest(&home)).ok();
    reference.begin_placed_motion(0);
    tracker.start(constants, 0, 0);
    let mut error = PoseError::default();
    for (k, (time_ms, displacement)) in measured.iter().enumerate() {
        let pose = home.displaced(displacement);
        let length_m = leg_lengths(constants.machine(), &pose);
        let measurement = Measurement {
            time_ns: time_ms * MS,
            length_m,
            rate_m_s: Some([0.0; LEGS]),
            ..Measurement::default()
        };
        let located = located(&measurement, pose, Twist::default());
        let cycle = Cycle { constants, release_ns: (k as u64 + 1) * MS, state: State::Active };
        (error, _) = tracker.update(&cycle, &reference, &Localization::new(constants), &located);
    }
    error
}

#[test]
fn a_leg_that_leaves_the_prediction_ends_the_trust() {
    let machine = machine(&mut RandomVectors::new(74));
    let constants = Constants::new(&machine, parameters(&machine));
    let bound = constants.estimator.innovation_bound_m(1e-3);
    for axis in 0..3 {
        let direction = Vector3::ith(axis, 1.0);
        let mut unit = Vector6::zeros();
        unit.fixed_rows_mut::<3>(3).copy_from(&direction);
        let of_legs = leg_wrenches(&machine, constants.home.pose()).tr_mul(&unit).abs();
        let largest = of_legs.max();
        // In the second case the platform is beyond the bound, but no leg is. In the third case the farthest
        // leg is, too.
        for (distance, is_trusted) in [(0.99, true), (0.97 / largest, true), (1.03 / largest, false)] {
            let mut tracker = ErrorTracker::default();
            let displacement = Twist { linear: direction * (distance * bound), ..Twist::default() };
            updated(&constants, &mut tracker, &[(1, displacement)]);
            let found = tracker.sensor_or_drive_fault().copied();
            assert_eq!(found.is_none(), is_trusted, "{axis} {distance}");
            if let Some(found) = found {
                assert_eq!(found.code, DiagnosticCode::MeasurementImplausible);
                assert!(of_legs[found.index as usize - 1] > 0.99 * largest, "{axis}: {found:?}");
            }
        }
    }
}

#[test]
fn in_modes_on_legs_the_error_stays_that_of_the_last_measurement() {
    let machine = machine(&mut RandomVectors::new(74));
    let mut parameters = parameters(&machine);
    parameters.law.mode = ControlMode::JointPd;
    let constants = Constants::new(&machine, parameters);
    let displacement = Twist { linear: Vector3::new(1e-3, -2e-3, 3e-3), ..Twist::default() };
    let error = updated(&constants, &mut ErrorTracker::default(), &[(1, displacement); 3]);
    assert!((error.pose.linear + displacement.linear).norm() < 1e-12, "{error:?}");
    assert!(error.pose.angular.norm() < 1e-12 && error.twist.vector().norm() < 1e-12, "{error:?}");
}
