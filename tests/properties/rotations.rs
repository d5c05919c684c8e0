//! Rotations, rotation vectors, Bryan angles.

use super::*;

/// Angles over all magnitudes, not only those near one.
fn angle() -> impl Strategy<Value = f64> {
    prop_oneof![0.0..(PI - 1e-3), (-12.0..0.0f64).prop_map(|power| 10f64.powf(power)), Just(0.0)]
}

proptest! {
    #![proptest_config(cases(1000))]

    #[test]
    fn exp_is_a_rotation_about_its_vector(axis in direction(), angle in angle()) {
        let r = exp(&(axis * angle));
        prop_assert!((r.transpose() * r - Matrix3::identity()).amax() < 4e-15);
        prop_assert!((r.determinant() - 1.0).abs() < 4e-15);
        prop_assert!((r * axis - axis).amax() < 4e-15);
        let across = axis.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
        let turned = across * angle.cos() + axis.cross(&across) * angle.sin();
        prop_assert!((r * across - turned).amax() < 4e-15, "counterclockwise by the angle");
    }

    #[test]
    fn log_inverts_exp(axis in direction(), angle in angle()) {
        let w = axis * angle;
        // The axis of a half turn is determined only up to sign.
        let bound = 1e-14 + 1e-15 * angle / (PI - angle);
        prop_assert!((log(&exp(&w)) - w).norm() < bound.max(1e-13 * angle));
    }

    #[test]
    fn displacements_lead_from_pose_to_pose(a in rotation(), b in rotation(), p in vector3(), q in vector3()) {
        let (from, to) = (Pose { rotation: a, position: p }, Pose { rotation: b, position: q });
        // The axis of a rotation becomes ill determined toward half a turn, as its sine vanishes.
        let bound = 1e-13 + 3e-15 / (PI - angle_between(&a, &b)).abs().max(1e-9);
        let there = from.displacement_to(&to);
        let found = from.displaced(&there);
        prop_assert!(angle_between(&found.rotation, &b) < bound && (found.position - q).norm() < 1e-14);
        let back = to.displacement_to(&from);
        prop_assert!((back.angular + there.angular).norm() < bound || there.angular.norm() > PI - 1e-7);
        prop_assert_eq!(back.linear, -there.linear);
        prop_assert_eq!(Twist::from_vector(&there.vector()), there);
    }

    #[test]
    fn task_coordinates_invert_the_pose(x in vector6(), near in vector6()) {
        // Several turns in every angle, beta beyond 90 degrees included; the guess is within 0.3 rad.
        let mut x = x * 7.0;
        if x[1].cos().abs() < 1e-3 {
            x[1] += 0.1;
        }
        let bound = 1e-14 / x[1].cos().abs();
        // Two triples of angles give one pose; they are 2 |cos(beta)|, at least, apart.
        let guess = x + near * (0.3 * x[1].cos().abs());
        let found = task_coordinates(&TaskState::at_rest(x.into()).motion().pose, &guess.into());
        for (a, b) in found.iter().zip(&x) {
            prop_assert!((a - b).abs() < bound, "{found:?} for {x:?}");
        }
    }

    /// Whatever the guess, the coordinates belong to the pose.
    #[test]
    fn task_coordinates_belong_to_the_pose(r in rotation(), near in vector6()) {
        let pose = Pose { rotation: r, position: Vector3::new(0.1, -0.2, 0.3) };
        let [alpha, beta, gamma, x, y, z] = task_coordinates(&pose, &(near * 10.0).into());
        prop_assert!((hexad_support::rotation(alpha, beta, gamma) - r).amax() < 1e-13);
        prop_assert_eq!([x, y, z], [0.1, -0.2, 0.3]);
    }
}
