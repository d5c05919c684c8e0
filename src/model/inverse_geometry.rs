//! Inverse geometric model (paper, eq. 3-5) and its first two time derivatives.
//!
//! ```text
//! b   = R CB                    s = C + b - A          L = |s|,   n = s / L
//! vB  = v + omega x b           L'  = n . vB                      n'  = (vB - L' n) / L
//! aB  = v' + omega' x b + omega x (omega x b)
//!                               L'' = n . aB + L |n'|^2           n'' = (aB - L'' n - 2 L' n') / L
//! ```
//!
//! Valid for L > 0. No leg angles appear, hence no joint-angle singularity.

use fearless_simd::{Simd, dispatch, f64x8};
use nalgebra::Vector3;

use super::lanes::{Eight, Lanes3};
use super::machine::{LEGS, Machine};
use super::rigid::{Acceleration, Motion, Pose, Twist};

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

/// Second time derivatives.
#[derive(Clone, Copy)]
pub(super) struct LegAcceleration<V> {
    /// L''
    pub accel: V,
    /// n''
    pub direction: Lanes3<V>,
}

impl<V> LegGeometry<V> {
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, machine: &Machine, pose: &Pose) -> Self
    where
        V: Eight<S>,
    {
        let arm = Lanes3::<V>::load(simd, &machine.joints.platform).transformed(simd, &pose.rotation);
        let s = Lanes3::splat(simd, &pose.position) + arm - Lanes3::load(simd, &machine.joints.base);
        let length = s.dot(s).sqrt();
        let inverse_length = V::splat(simd, 1.0) / length;
        Self { arm, direction: s * inverse_length, length, inverse_length }
    }

    #[inline(always)]
    pub fn velocity<S: Simd>(&self, simd: S, twist: &Twist) -> LegVelocity<V>
    where
        V: Eight<S>,
    {
        let joint = Lanes3::splat(simd, &twist.linear) + Lanes3::splat(simd, &twist.angular).cross(self.arm);
        let rate = self.direction.dot(joint);
        let direction = joint.plus_scaled(-rate, self.direction) * self.inverse_length;
        LegVelocity { rate, direction }
    }

    #[inline(always)]
    pub fn acceleration<S: Simd>(
        &self,
        simd: S,
        twist: &Twist,
        acceleration: &Acceleration,
        velocity: &LegVelocity<V>,
    ) -> LegAcceleration<V>
    where
        V: Eight<S>,
    {
        // omega' x b + omega x (omega x b) = (omega'~ + omega~ omega~) b: one 3 x 3 for all legs
        let omega = twist.angular.cross_matrix();
        let map = acceleration.angular.cross_matrix() + omega * omega;
        let joint = Lanes3::splat(simd, &acceleration.linear) + self.arm.transformed(simd, &map);
        let turn = velocity.direction;
        let accel = self.length.mul_add(turn.dot(turn), self.direction.dot(joint));
        let direction = joint.plus_scaled(-accel, self.direction).plus_scaled(-(velocity.rate + velocity.rate), turn)
            * self.inverse_length;
        LegAcceleration { accel, direction }
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
    let unpack = |lane| machine.joints.triples.unpack(&lane);
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::<f64x8<_>>::new(simd, machine, &motion.pose);
        let velocity = legs.velocity(simd, &motion.twist);
        let acceleration = legs.acceleration(simd, &motion.twist, &motion.acceleration, &velocity);
        LegMotion {
            length: unpack(legs.length.store()),
            rate: unpack(velocity.rate.store()),
            accel: unpack(acceleration.accel.store()),
        }
    })
}

/// `L_i` \[m\].
pub fn leg_lengths(machine: &Machine, pose: &Pose) -> [f64; LEGS] {
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::<f64x8<_>>::new(simd, machine, pose);
        machine.joints.triples.unpack(&legs.length.store())
    })
}

/// `n_i`, unit vectors from base to platform, base axes.
pub fn leg_directions(machine: &Machine, pose: &Pose) -> [Vector3<f64>; LEGS] {
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::<f64x8<_>>::new(simd, machine, pose);
        machine.joints.triples.unpack_vectors(&legs.direction.store())
    })
}
