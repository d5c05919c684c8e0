//! Inverse geometric model (paper, eq. 3-5) and its first two time derivatives.
//!
//! ```text
//! b   = R CB                    s = C + b - A          L = |s|,   n = s / L
//! vB  = v + omega x b           L'  = n . vB                      n'  = (vB - L' n) / L
//! aB  = v' + S b                L'' = n . aB + L |n'|^2           n'' = (aB - L'' n - 2 L' n') / L
//! ```
//!
//! with `S b = omega' x b + omega x (omega x b)`; n'' itself is nowhere needed.
//!
//! Valid for L > 0. No leg angles appear, hence no joint-angle singularity.

use fearless_simd::{Simd, dispatch, f64x8};
use nalgebra::{Matrix3, Vector3};

use super::lanes::{Eight, Reals};
use super::lanes3::Lanes3;
use super::machine::{Joints, LEGS, Machine};
use super::platform::acceleration_map;
use super::rigid::{Acceleration, Motion, Pose, Twist};
use super::triples::{Constant, Lane};

/// Geometry of the six legs at one pose.
#[derive(Clone, Copy)]
pub(super) struct LegGeometry<V> {
    /// b, from C to the joint on the platform.
    pub arm: Lanes3<V>,
    /// n, unit vector from base to platform.
    pub direction: Lanes3<V>,
    /// L
    pub length: V,
    /// 1 / L
    pub inverse_length: V,
}

/// First time derivatives.
#[derive(Clone, Copy)]
pub(super) struct LegVelocity<V> {
    /// L'
    pub rate: V,
    /// n'
    pub direction: Lanes3<V>,
}

impl<V> LegGeometry<V> {
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, joints: &Joints, pose: &Pose<V::Scalar>) -> Self
    where
        V: Eight<S>,
    {
        Self::of(simd, &joints.platform, joints, pose)
    }

    /// With arms from the mean of the joints on the platform, wherever C is.
    #[inline(always)]
    pub fn around_center<S: Simd>(simd: S, joints: &Joints, pose: &Pose) -> Self
    where
        V: Eight<S, Scalar = f64>,
    {
        let position = pose.position + pose.rotation * joints.center;
        Self::of(simd, &joints.around_center, joints, &Pose { rotation: pose.rotation, position })
    }

    #[inline(always)]
    fn of<S: Simd>(simd: S, platform: &[Constant; 3], joints: &Joints, pose: &Pose<V::Scalar>) -> Self
    where
        V: Eight<S>,
    {
        let arm =
            Lanes3::<V>::constant(simd, platform).transformed(&pose.rotation, |value| V::spread(simd, value));
        let s = Lanes3::spread(simd, &pose.position) + arm - Lanes3::constant(simd, &joints.base);
        let length = s.dot(s).sqrt();
        let inverse_length = V::splat(simd, 1.0) / length;
        Self { arm, direction: s * inverse_length, length, inverse_length }
    }

    #[inline(always)]
    pub fn velocity<S: Simd>(&self, simd: S, twist: &Twist<V::Scalar>) -> LegVelocity<V>
    where
        V: Eight<S>,
    {
        let joint =
            Lanes3::spread(simd, &twist.linear) + Lanes3::spread(simd, &twist.angular).cross(self.arm);
        let rate = self.direction.dot(joint);
        let direction = joint.plus_scaled(-rate, self.direction) * self.inverse_length;
        LegVelocity { rate, direction }
    }

    /// aB, with `acceleration_map` from [`super::platform::acceleration_map`].
    #[inline(always)]
    pub fn joint_acceleration<S: Simd>(
        &self,
        simd: S,
        acceleration: &Acceleration<V::Scalar>,
        acceleration_map: &Matrix3<V::Scalar>,
    ) -> Lanes3<V>
    where
        V: Eight<S>,
    {
        let relative = self.arm.transformed(acceleration_map, |value| V::spread(simd, value));
        Lanes3::spread(simd, &acceleration.linear) + relative
    }

    /// L''
    #[inline(always)]
    pub fn accel(&self, velocity: &LegVelocity<V>, joint_acceleration: Lanes3<V>) -> V
    where
        V: Reals,
    {
        let turn = velocity.direction;
        self.length.mul_add(turn.dot(turn), self.direction.dot(joint_acceleration))
    }
}

/// Lengths of the legs and their time derivatives: \[m\], \[m/s\], \[m/s^2\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegMotion {
    pub length: [f64; LEGS],
    pub rate: [f64; LEGS],
    pub accel: [f64; LEGS],
}

/// Lengths, rates and accelerations of the six legs for a motion of the platform.
pub fn leg_motion(machine: &Machine, motion: &Motion) -> LegMotion {
    let unpack = |lane: Lane| machine.joints.triples.unpack(&lane);
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::<f64x8<_>>::new(simd, &machine.joints, &motion.pose);
        let velocity = legs.velocity(simd, &motion.twist);
        let map = acceleration_map(&motion.twist, &motion.acceleration);
        let accel = legs.accel(&velocity, legs.joint_acceleration(simd, &motion.acceleration, &map));
        LegMotion {
            length: unpack(legs.length.store()),
            rate: unpack(velocity.rate.store()),
            accel: unpack(accel.store()),
        }
    })
}

/// `L_i` \[m\].
pub fn leg_lengths(machine: &Machine, pose: &Pose) -> [f64; LEGS] {
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::<f64x8<_>>::new(simd, &machine.joints, pose);
        machine.joints.triples.unpack(&legs.length.store())
    })
}

/// `n_i`, unit vectors from base to platform, base axes.
pub fn leg_directions(machine: &Machine, pose: &Pose) -> [Vector3<f64>; LEGS] {
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::<f64x8<_>>::new(simd, &machine.joints, pose);
        machine.joints.triples.unpack_vectors(&legs.direction.store())
    })
}
