//! What a kinematic_state keeps is what would be computed anew.

use super::*;

/// A kinematic_state that forward kinematics moved to the motion's pose.
fn arrived(machine: &Machine, motion: &Motion, from: &Vector6<f64>) -> KinematicState {
    let r = machine.joints.radius_m;
    let away = from * 1e-3;
    let step = Twist { angular: away.fixed_rows::<3>(0).into(), linear: away.fixed_rows::<3>(3) * r };
    let mut kinematic_state = KinematicState::new(machine, motion.pose.displaced(&step));
    let report = refine(machine, &mut kinematic_state, &leg_lengths(machine, &motion.pose));
    assert_eq!(report.outcome, Outcome::Solved, "{report:?}");
    kinematic_state
}

/// Displaced by `[rotation; translation / radius]` of the mean of the joints on the platform.
fn displaced_center(machine: &Machine, pose: &Pose, step: &Vector6<f64>) -> Pose {
    let center = Legs::of(machine).platform.iter().sum::<Vector3<f64>>() / 6.0;
    let rotation = exp(&step.fixed_rows::<3>(0).into()) * pose.rotation;
    let shift = step.fixed_rows::<3>(3) * machine.joints.radius_m;
    Pose { rotation, position: pose.position + pose.rotation * center + shift - rotation * center }
}

proptest! {
    #![proptest_config(cases(1000))]

    #[test]
    fn twists_share_the_factorization((machine, _, motion) in machine_in_motion(), from in vector6()) {
        let rates = leg_motion(&machine, &motion).rate_m_s;
        let bound = 1e-12 * condition(&machine, &motion.pose);
        for kinematic_state in [KinematicState::new(&machine, motion.pose), arrived(&machine, &motion, &from)] {
            let twist = kinematic_state.twist(&machine, &rates).unwrap().vector();
            let anew = twist_from_rates(&machine, &motion.pose, &rates).unwrap().vector();
            prop_assert!(relative(twist.as_slice(), anew.as_slice()) < bound);
            prop_assert!(relative(&kinematic_state.lengths(&machine), &leg_lengths(&machine, &motion.pose)) < 1e-12);
        }
    }

    #[test]
    fn sensitivity_is_that_of_n((machine, _, motion) in machine_in_motion()) {
        let known = *KinematicState::new(&machine, motion.pose).sensitivity();
        let n = scaled_wrenches(&machine, &motion.pose);
        let frobenius = n.norm() * n.try_inverse().unwrap().norm();
        prop_assert!((known.condition / frobenius - 1.0).abs() < 1e-11 * frobenius);
        let of_two_norm = condition(&machine, &motion.pose);
        prop_assert!((1.0..6.0).contains(&(known.condition / of_two_norm)));
        let determinant = leg_wrenches(&machine, &motion.pose).determinant() / machine.joints.radius_m.powi(3);
        prop_assert!((known.determinant - determinant).abs() < 1e-12 * determinant.abs().max(1.0));
    }

    /// Within the trusted step Newton's method arrives where the lengths came from, from the very edge too.
    #[test]
    fn trusted_steps_can_be_trusted(
        (machine, _, motion) in machine_in_motion(),
        towards in vector6(),
        share in prop_oneof![Just(0.9), 0.0..0.9f64],
    ) {
        let mut kinematic_state = KinematicState::new(&machine, motion.pose);
        let r = machine.joints.radius_m;
        let size = kinematic_state.sensitivity().trusted_step * share;
        let unit = towards / towards.norm().max(1e-3);
        let there = displaced_center(&machine, &motion.pose, &(unit * size));
        let report = refine(&machine, &mut kinematic_state, &leg_lengths(&machine, &there));
        prop_assert_eq!(report.outcome, Outcome::Solved, "{:?}", report);
        let error = kinematic_state.pose().displacement_to(&there);
        prop_assert!(error.angular.norm() + error.linear.norm() / r < 1e-11, "{error:?}");
    }
}
