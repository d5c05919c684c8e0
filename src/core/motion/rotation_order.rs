//! Orientations as other programs write them: angles in any order of the rotations, and quaternions.
//!
//! The angles have the names of their axes in every order: alpha about x, beta about y, gamma about z. An order is named
//! after the product: `zyx` is `R = Rz(gamma) Ry(beta) Rx(alpha)`. X has the order `xyz`.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3, Vector6};

use crate::model::rigid::{Acceleration, Motion, Pose, Twist};
use crate::model::task::{TaskState, task_coordinates};

crate::named! {
    /// Order in which the rotations by alpha, beta and gamma are multiplied.
    ///
    /// ```
    /// use hexad_core::model::task::TaskState;
    /// use hexad_core::motion::rotation_order::RotationOrder;
    /// let x = [0.0, 0.5, 1.5, 0.0, 0.0, 1.0];
    /// let pose = RotationOrder::Zyx.motion(&TaskState::at_rest(x)).pose;
    /// // Of Rz(gamma) Ry(beta), the third axis has the direction of beta, turned by gamma.
    /// let [alpha, beta, gamma, ..] = RotationOrder::Xyz.coordinates(&pose, &x);
    /// assert!((pose.rotation.m33 - alpha.cos() * beta.cos()).abs() < 1e-15 && (gamma - 1.5).abs() > 1e-3);
    /// ```
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum RotationOrder {
        /// `Rx(alpha) Ry(beta) Rz(gamma)`, the order of X
        #[default]
        Xyz => "xyz",
        /// `Rx(alpha) Rz(gamma) Ry(beta)`
        Xzy => "xzy",
        /// `Ry(beta) Rx(alpha) Rz(gamma)`
        Yxz => "yxz",
        /// `Ry(beta) Rz(gamma) Rx(alpha)`
        Yzx => "yzx",
        /// `Rz(gamma) Rx(alpha) Ry(beta)`
        Zxy => "zxy",
        /// `Rz(gamma) Ry(beta) Rx(alpha)`
        Zyx => "zyx",
    }
}

impl RotationOrder {
    /// Motion of a state like a [`TaskState`], with angles and their derivatives in this order.
    ///
    /// P takes the first axis of rotation to x, the second to y, the third to z: `P R P^T` has the order of X. If P is a
    /// reflection, it turns every angle and every angular velocity around.
    pub fn motion(self, state: &TaskState) -> Motion {
        let (p, parity) = self.permutation();
        let of_x = |x: &Vector6<f64>| {
            let mut x = *x;
            let angles: Vector3<f64> = x.fixed_rows::<3>(0).into();
            x.fixed_rows_mut::<3>(0).copy_from(&(p * angles * parity));
            x
        };
        let TaskState { x, xd, xdd } = state;
        let Motion { pose, twist, acceleration } =
            TaskState { x: of_x(x), xd: of_x(xd), xdd: of_x(xdd) }.motion();
        let back = p.transpose() * parity;
        Motion {
            pose: Pose { rotation: p.transpose() * pose.rotation * p, ..pose },
            twist: Twist { angular: back * twist.angular, ..twist },
            acceleration: Acceleration { angular: back * acceleration.angular, ..acceleration },
        }
    }

    /// Angles in this order, and position, of a pose: as [`task_coordinates`], of which this is the inverse for `xyz`.
    pub fn coordinates(self, pose: &Pose, near: &[f64; 6]) -> [f64; 6] {
        let (p, parity) = self.permutation();
        let [alpha, beta, gamma, ..] = *near;
        let [a, b, c] = (p * Vector3::new(alpha, beta, gamma) * parity).into();
        let rotated = Pose { rotation: p * pose.rotation * p.transpose(), ..*pose };
        let [a, b, c, x, y, z] = task_coordinates(&rotated, &[a, b, c, 0.0, 0.0, 0.0]);
        let [alpha, beta, gamma] = (p.transpose() * Vector3::new(a, b, c) * parity).into();
        [alpha, beta, gamma, x, y, z]
    }

    /// Matrix with the axes of rotation as rows, and its determinant, 1 or -1.
    fn permutation(self) -> (Matrix3<f64>, f64) {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| axis.transpose());
        let (rows, parity) = match self {
            Self::Xyz => ([x, y, z], 1.0),
            Self::Xzy => ([x, z, y], -1.0),
            Self::Yxz => ([y, x, z], -1.0),
            Self::Yzx => ([y, z, x], 1.0),
            Self::Zxy => ([z, x, y], 1.0),
            Self::Zyx => ([z, y, x], -1.0),
        };
        (Matrix3::from_rows(&rows), parity)
    }
}

/// Rotation of a quaternion `w x y z` of any norm but 0; of two opposite quaternions it is the same.
pub fn rotation_of([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    *UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix().matrix()
}

/// Unit quaternion `w x y z` of a rotation; of the two, the one nearest to `near`.
pub fn quaternion_of(rotation: &Matrix3<f64>, near: &[f64; 4]) -> [f64; 4] {
    let found = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
    let [x, y, z, w]: [f64; 4] = found.into_inner().coords.into();
    let found = [w, x, y, z];
    let cosine: f64 = found.iter().zip(near).map(|(a, b)| a * b).sum();
    if cosine < 0.0 { found.map(core::ops::Neg::neg) } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rigid::exp;

    const X: [f64; 6] = [0.3, 1.1, -0.8, 0.1, 0.2, 1.0];

    #[test]
    fn the_name_is_that_of_the_product() {
        let [alpha, beta, gamma, ..] = X;
        let about = |letter| match letter {
            'x' => exp(&(Vector3::x() * alpha)),
            'y' => exp(&(Vector3::y() * beta)),
            _ => exp(&(Vector3::z() * gamma)),
        };
        for order in RotationOrder::ALL {
            let product = order.name().chars().map(about).fold(Matrix3::identity(), |a, b| a * b);
            let pose = order.motion(&TaskState::at_rest(X)).pose;
            assert!((pose.rotation - product).amax() < 1e-15, "{order:?}");
            assert!((pose.position - Vector3::new(0.1, 0.2, 1.0)).amax() == 0.0);
            let back = order.coordinates(&pose, &X);
            assert!(back.iter().zip(X).all(|(a, b)| (a - b).abs() < 1e-15), "{order:?}: {back:?}");
        }
    }

    #[test]
    fn rates_are_the_derivatives_of_the_pose_in_every_order() {
        let state = TaskState {
            x: X.into(),
            xd: Vector6::new(1.0, -2.0, 0.5, 0.3, 0.0, -0.1),
            xdd: Vector6::new(-3.0, 1.0, 2.0, 0.0, 1.0, 0.5),
        };
        let h = 1e-5;
        for order in RotationOrder::ALL {
            let [before, now, after] = [-h, 0.0, h].map(|dt| order.motion(&state.after(dt)));
            let moved = before.pose.displacement_to(&after.pose).vector() / (2.0 * h);
            assert!((moved - now.twist.vector()).amax() < 1e-8, "{order:?}");
            let change = (after.twist.vector() - before.twist.vector()) / (2.0 * h);
            assert!((change - now.acceleration.vector()).amax() < 1e-8, "{order:?}");
            let back = TaskState::of_motion(&now, &order.coordinates(&now.pose, &X)).unwrap();
            let again = back.motion();
            assert!((again.twist.vector() - now.twist.vector()).amax() < 1e-14, "{order:?}");
            assert!((again.acceleration.vector() - now.acceleration.vector()).amax() < 1e-13, "{order:?}");
        }
    }

    #[test]
    fn a_quaternion_of_any_size_and_sign_is_one_rotation() {
        let rotation = exp(&Vector3::new(0.2, -2.9, 0.4));
        let near = quaternion_of(&rotation, &[1.0, 0.0, 0.0, 0.0]);
        assert!(near[0] > 0.0 && (rotation_of(near) - rotation).amax() < 1e-15);
        let far = quaternion_of(&rotation, &near.map(|q| -q));
        assert_eq!(far, near.map(|q| -q));
        assert!((rotation_of(far.map(|q| 3.0 * q)) - rotation).amax() < 1e-15);
    }
}
