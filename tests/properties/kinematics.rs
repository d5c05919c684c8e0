//! Lengths, rates and accelerations of the legs, and the way back to pose and twist.

use super::*;

/// Step of the differences \[s\]: truncation and rounding meet near 1e-9 of the scale of the motion.
const STEP: f64 = 1e-4;

/// (-f(2h) + 8 f(h) - 8 f(-h) + f(-2h)) / 12 h
fn derivative(f: impl Fn(f64) -> [f64; 6]) -> Vector6<f64> {
    let f = |t: f64| Vector6::from(f(t));
    ((f(STEP) - f(-STEP)) * 8.0 - (f(2.0 * STEP) - f(-2.0 * STEP))) / (12.0 * STEP)
}

proptest! {
    #![proptest_config(cases(1000))]

    #[test]
    fn lengths_are_distances_of_the_joints((machine, _, motion) in machine_in_motion()) {
        let Legs { base, platform, .. } = Legs::of(&machine);
        let lengths = leg_lengths(&machine, &motion.pose);
        let directions = leg_directions(&machine, &motion.pose);
        for i in 0..6 {
            let b = motion.pose.position + motion.pose.rotation * platform[i];
            prop_assert!(((b - base[i]).norm() / lengths[i] - 1.0).abs() < 1e-14);
            prop_assert!((base[i] + directions[i] * lengths[i] - b).norm() < 1e-14 * lengths[i].max(1.0));
        }
    }

    #[test]
    fn rates_and_accels_are_the_derivatives_of_lengths((machine, state, motion) in machine_in_motion()) {
        let legs = leg_motion(&machine, &motion);
        let at = |t: f64| leg_motion(&machine, &state.after(t).motion());
        let rates = derivative(|t| at(t).length_m);
        let accels = derivative(|t| at(t).rate_m_s);
        let scale = machine.joints.radius_m;
        prop_assert!((rates - Vector6::from(legs.rate_m_s)).amax() < 1e-9 * scale.max(largest(&legs.length_m)));
        prop_assert!((accels - Vector6::from(legs.accel_m_s2)).amax() < 1e-8 * scale.max(largest(&legs.length_m)));
    }

    /// `L' = N^T [omega; v]`, and N belongs to the lengths: an imposed displacement changes them by `N^T d`.
    #[test]
    fn the_jacobian_is_the_derivative_of_the_lengths(
        (machine, _, motion) in machine_in_motion(),
        towards in vector6(),
    ) {
        let n = leg_wrenches(&machine, &motion.pose);
        let rates = n.transpose() * motion.twist.vector();
        prop_assert!((rates - Vector6::from(leg_motion(&machine, &motion).rate_m_s)).amax() < 1e-13 * rates.amax());
        let way = Twist::from_vector(&towards);
        let displaced = |t: f64| {
            let step = Twist { angular: way.angular * t, linear: way.linear * t };
            leg_lengths(&machine, &motion.pose.displaced(&step))
        };
        let scale = largest(&leg_lengths(&machine, &motion.pose)).max(1.0);
        // A unit displacement is large beside a small machine: its fifth derivative is too.
        let bound = 1e-9 * scale * (1.0 / machine.joints.radius_m).powi(4).max(1.0);
        prop_assert!((derivative(displaced) - n.transpose() * towards).amax() < bound);
    }

    /// Down to the rounding of the lengths: what is left out of a slow motion would depend on the instruction set.
    #[test]
    fn the_smallest_motions_are_followed(
        (machine, _, motion) in machine_in_motion(),
        towards in vector6(),
        exponent in -14.0..-10.0,
    ) {
        let r = machine.joints.radius_m;
        prop_assume!(towards.norm() > 0.1);
        let way = towards.normalize() * 10.0_f64.powf(exponent);
        let step = Twist { angular: way.fixed_rows::<3>(0).into(), linear: way.fixed_rows::<3>(3) * r };
        let moved = motion.pose.displaced(&step);
        let mut tracker = Tracker::new(&machine, motion.pose);
        let (result, _) = tracker.advance(&machine, &leg_lengths(&machine, &moved));
        prop_assert_eq!(result, TrackingResult::Found);
        let size = 1.0 + motion.pose.position.norm() / r;
        let rounding = 64.0 * f64::EPSILON * size * condition(&machine, &motion.pose);
        let apart = machine.joints.distance(tracker.pose(), &moved);
        prop_assert!(apart < rounding, "{apart:e} {rounding:e}");
    }

    #[test]
    fn twists_follow_from_rates((machine, _, motion) in machine_in_motion()) {
        let rates = leg_motion(&machine, &motion).rate_m_s;
        let twist = twist_from_rates(&machine, &motion.pose, &rates).unwrap().vector();
        let wanted = motion.twist.vector();
        let r = machine.joints.radius_m;
        let scaled = |v: Vector6<f64>| v.component_mul(&Vector6::new(r, r, r, 1.0, 1.0, 1.0));
        let bound = 1e-14 * condition(&machine, &motion.pose) * scaled(wanted).amax();
        prop_assert!(scaled(twist - wanted).amax() < bound);
    }

    #[test]
    fn forward_kinematics_inverts_inverse((machine, _, motion) in machine_in_motion()) {
        let lengths = leg_lengths(&machine, &motion.pose);
        let home = machine.home_pose();
        let mut tracker = Tracker::new(&machine, home);
        prop_assert_eq!(tracker.find(&machine, &lengths).0, TrackingResult::Found);
        let bound = 1e-14 * condition(&machine, &motion.pose) * largest(&lengths).max(1.0);
        prop_assert!((tracker.pose().position - motion.pose.position).norm() < bound);
        prop_assert!(angle_between(&tracker.pose().rotation, &motion.pose.rotation) < bound / machine.joints.radius_m);

        // What moves a platform in a millisecond takes four steps, two or three of them with new factors.
        let Motion { twist, .. } = motion;
        let step = Twist { angular: twist.angular * 1e-3, linear: twist.linear * 1e-3 };
        let mut kinematic_state = KinematicState::new(&machine, motion.pose.displaced(&step));
        let report = refine(&machine, &mut kinematic_state, &lengths);
        prop_assert!(report.outcome == Outcome::Solved && report.iterations <= 4, "{report:?}");
        prop_assert!((kinematic_state.pose().position - motion.pose.position).norm() < bound);
    }
}
