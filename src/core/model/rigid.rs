//! Pose, twist, acceleration and wrench of the mobile platform, each a type of its own.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix3, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// Pose of the platform: orientation and position in the base frame.
///
/// ```
/// use hexad_core::model::rigid::{Pose, Twist};
/// use nalgebra::{Matrix3, Vector3};
/// let start = Pose { rotation: Matrix3::identity(), position: Vector3::zeros() };
/// let step = Twist { angular: Vector3::new(0.3, -0.2, 0.1), linear: Vector3::new(0.0, 0.0, 0.5) };
/// // displacement_to inverts displaced: a rotation vector, never a difference of angles.
/// let back = start.displacement_to(&start.displaced(&step));
/// assert!((back.vector() - step.vector()).amax() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// R, platform axes expressed in base axes.
    pub rotation: Matrix3<f64>,
    /// C, the platform origin in base axes \[m\].
    pub position: Vector3<f64>,
}

/// Twist of the platform: angular velocity, and velocity of the platform origin C.
///
/// ```
/// use hexad_core::model::rigid::{Twist, Wrench};
/// // Power is wrench times twist: 2 N m at 3 rad/s, and 5 N against 1 m/s.
/// let twist = Twist { angular: [3.0, 0.0, 0.0].into(), linear: [0.0, 0.0, -1.0].into() };
/// let wrench = Wrench { torque: [2.0, 0.0, 0.0].into(), force: [0.0, 0.0, 5.0].into() };
/// assert_eq!(wrench.vector().dot(&twist.vector()), 1.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// omega, base axes \[rad/s\].
    pub angular: Vector3<f64>,
    /// v, velocity of C, base axes \[m/s\].
    pub linear: Vector3<f64>,
}

/// Acceleration of the platform: the time derivative of its twist, part by part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Acceleration {
    /// omega', base axes \[rad/s^2\].
    pub angular: Vector3<f64>,
    /// v', acceleration of C, base axes \[m/s^2\].
    pub linear: Vector3<f64>,
}

/// Wrench on the platform: torque about C, and force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Torque about C, base axes \[N m\].
    pub torque: Vector3<f64>,
    /// Force, base axes \[N\].
    pub force: Vector3<f64>,
}

/// Motion of the platform at one instant: pose, twist and acceleration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// R and C.
    pub pose: Pose,
    /// omega and v.
    pub twist: Twist,
    /// omega' and v'.
    pub acceleration: Acceleration,
}

impl Motion {
    /// Motion `dt_s` seconds later (or earlier) under constant acceleration. The rotation is about a fixed
    /// axis: the rotation of the axis itself, `|omega x omega'| dt^3 / 12`, is left out.
    pub fn after(&self, dt_s: f64) -> Self {
        let (v, a) = (self.twist.vector(), self.acceleration.vector());
        Self {
            pose: self.pose.extrapolated(&Twist::from_vector(&((v + a * (0.5 * dt_s)) * dt_s))),
            twist: Twist::from_vector(&(v + a * dt_s)),
            acceleration: self.acceleration,
        }
    }
}

macro_rules! six_numbers {
    ($name:ident, $first:ident, $second:ident, $doc:literal) => {
        impl $name {
            #[doc = $doc]
            pub fn vector(&self) -> Vector6<f64> {
                let (a, b) = (&self.$first, &self.$second);
                Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)
            }

            /// Inverse of `vector`.
            pub fn from_vector(v: &Vector6<f64>) -> Self {
                Self { $first: v.fixed_rows::<3>(0).into(), $second: v.fixed_rows::<3>(3).into() }
            }
        }
    };
}

six_numbers!(Twist, angular, linear, "`[omega; v]`");
six_numbers!(Acceleration, angular, linear, "`[omega'; v']`");
six_numbers!(Wrench, torque, force, "`[torque; force]`");

impl Pose {
    /// Pose after the displacement `[dw; dv]`: `R <- exp(dw~) R`, `C <- C + dv`, both in base axes.
    ///
    /// One step of Newton's iteration for the polar factor makes R orthonormal again, so that rounding does
    /// not accumulate over millions of displacements.
    pub fn displaced(&self, displacement: &Twist) -> Self {
        Self {
            rotation: orthonormalized(&(exp(&displacement.angular) * self.rotation)),
            position: self.position + displacement.linear,
        }
    }

    /// The same pose without making R orthonormal again, for poses that are not displaced further.
    #[inline(always)]
    pub fn extrapolated(&self, displacement: &Twist) -> Self {
        Self {
            rotation: exp(&displacement.angular) * self.rotation,
            position: self.position + displacement.linear,
        }
    }

    /// Displacement `[dw; dv]` from `self` to `target`: `dw = log(R_target R^T)`.
    pub fn displacement_to(&self, target: &Self) -> Twist {
        Twist {
            angular: log(&(target.rotation * self.rotation.transpose())),
            linear: target.position - self.position,
        }
    }
}

/// Rotation matrix of a rotation vector `w`: Rodrigues' formula, exact for every angle.
#[inline(always)]
pub fn exp(turn_rad: &Vector3<f64>) -> Matrix3<f64> {
    let x = turn_rad.norm_squared();
    // Below 0.05 rad the series is exact to rounding and takes a third of the time.
    let (a, b) = if x < 2.5e-3 {
        (
            1.0 - x * (1.0 / 6.0 - x * (1.0 / 120.0 - x / 5040.0)),
            0.5 - x * (1.0 / 24.0 - x * (1.0 / 720.0 - x / 40320.0)),
        )
    } else {
        let angle = x.sqrt();
        let (sin, cos) = libm::sincos(angle);
        (sin / angle, (1.0 - cos) / x)
    };
    // I + a w~ + b w~^2 with w~^2 = w w^T - |w|^2 I.
    let (u, v) = (turn_rad * a, turn_rad * b);
    let (xy, xz, yz) = (v.x * turn_rad.y, v.x * turn_rad.z, v.y * turn_rad.z);
    let (xx, yy, zz) = (v.x * turn_rad.x, v.y * turn_rad.y, v.z * turn_rad.z);
    Matrix3::new(
        1.0 - (yy + zz),
        xy - u.z,
        xz + u.y,
        xy + u.z,
        1.0 - (xx + zz),
        yz - u.x,
        xz - u.y,
        yz + u.x,
        1.0 - (xx + yy),
    )
}

/// Rotation vector of a rotation matrix, angle in \[0, pi\]; inverse of [`exp`].
///
/// Well conditioned below about 3 rad. At pi the axis is determined up to sign.
pub fn log(r: &Matrix3<f64>) -> Vector3<f64> {
    // Axis times twice the sine of the angle.
    let axial = Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12);
    let twice_cos = r.trace() - 1.0;
    let x = 0.25 * axial.norm_squared();
    // Below 0.02 rad the series of the arcsine is exact to rounding.
    if x < 4e-4 && twice_cos > 0.0 {
        return axial * (0.5 + x * (1.0 / 12.0 + x * (3.0 / 80.0 + x * (5.0 / 224.0))));
    }
    let twice_sin = axial.norm();
    let angle = libm::atan2(twice_sin, twice_cos);
    if twice_sin > 1e-4 {
        return axial * (angle / twice_sin);
    }
    // Near a half turn the axis comes from R + I = 2 a a^T.
    let symmetric = r + r.transpose() + Matrix3::identity() * 2.0;
    let column = symmetric.column(symmetric.diagonal().imax());
    let axis = Vector3::from(column) / column.norm().max(f64::MIN_POSITIVE);
    let sign = if axis.dot(&axial) < 0.0 { -1.0 } else { 1.0 };
    axis * (angle * sign)
}

/// One step of Newton's iteration for the polar factor: `R (3 I - R^T R) / 2`.
fn orthonormalized(r: &Matrix3<f64>) -> Matrix3<f64> {
    let [a, b, c]: [Vector3<f64>; 3] = [r.column(0).into(), r.column(1).into(), r.column(2).into()];
    // The factor is symmetric.
    let diagonal = |v: &Vector3<f64>| 1.5 - 0.5 * v.norm_squared();
    let (ab, ac, bc) = (-0.5 * a.dot(&b), -0.5 * a.dot(&c), -0.5 * b.dot(&c));
    let factor = Matrix3::new(diagonal(&a), ab, ac, ab, diagonal(&b), bc, ac, bc, diagonal(&c));
    r * factor
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_finds_the_axis_of_a_half_turn() {
        for axis in [Vector3::x(), Vector3::new(0.3, -0.9, 0.2), Vector3::new(-1.0, -1.0, 1.0)] {
            let w = axis.normalize() * core::f64::consts::PI;
            let back = log(&exp(&w));
            assert!((back - w).norm().min((back + w).norm()) < 1e-7, "{back} for {w}");
        }
    }

    #[test]
    fn many_displacements_keep_the_rotation_orthonormal() {
        let mut pose = Pose { rotation: Matrix3::identity(), position: Vector3::zeros() };
        let step = Twist { angular: Vector3::new(1e-2, -2e-2, 3e-3), linear: Vector3::zeros() };
        for _ in 0..100_000 {
            pose = pose.displaced(&step);
        }
        let defect = (pose.rotation.transpose() * pose.rotation - Matrix3::identity()).amax();
        assert!(defect < 1e-15, "{defect}");
    }
}
