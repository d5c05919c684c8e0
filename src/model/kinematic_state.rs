//! The platform at one pose with everything that is worth computing once: its legs and the factorization of
//! `N`. Forward kinematics ends with one; twist, forces, condition and determinant then cost no second one.

use fearless_simd::{Simd, dispatch, f64x8};

use super::balance::{Balance, Factors};
use super::inverse_geometry::LegGeometry;
use super::lanes::Eight;
use super::lanes3::Lanes3;
use super::machine::{Joints, LEGS, Machine};
use super::rigid::{Pose, Twist};
use super::sensitivity::Sensitivity;
use super::triples::Lane;

/// One pose, its legs, its factorization.
#[derive(Clone, Copy, Debug)]
pub struct KinematicState {
    pub(super) pose: Pose,
    pub(super) legs: StoredLegs,
    pub(super) factors: Factors,
    pub(super) sensitivity: Sensitivity,
}

/// Legs in memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoredLegs {
    arm: [Lane; 3],
    direction: [Lane; 3],
    length: Lane,
    inverse_length: Lane,
}

impl StoredLegs {
    #[inline(always)]
    pub(super) fn new<S: Simd, V: Eight<S>>(legs: &LegGeometry<V>) -> Self {
        Self {
            arm: legs.arm.store(),
            direction: legs.direction.store(),
            length: legs.length.store(),
            inverse_length: legs.inverse_length.store(),
        }
    }

    #[inline(always)]
    pub(super) fn load<S: Simd, V: Eight<S>>(&self, simd: S) -> LegGeometry<V> {
        let vectors =
            |[x, y, z]: &[Lane; 3]| Lanes3 { x: V::load(simd, x), y: V::load(simd, y), z: V::load(simd, z) };
        LegGeometry {
            arm: vectors(&self.arm),
            direction: vectors(&self.direction),
            length: V::load(simd, &self.length),
            inverse_length: V::load(simd, &self.inverse_length),
        }
    }
}

impl KinematicState {
    /// At a known pose.
    pub fn new(machine: &Machine, pose: Pose) -> Self {
        let joints = &machine.joints;
        dispatch!(machine.level, simd => {
            let legs = LegGeometry::<f64x8<_>>::around_center(simd, joints, &pose);
            let balance = Balance::new(simd, joints, &legs);
            Self {
                pose,
                legs: StoredLegs::new(&legs),
                factors: balance.store(),
                sensitivity: Sensitivity::new(simd, joints, &legs, &balance),
            }
        })
    }

    /// The legs with arms from C, and what else the platform has in the padding of `joints`.
    #[inline(always)]
    pub(super) fn legs_with<S: Simd, V: Eight<S, Scalar = f64>>(
        &self,
        simd: S,
        joints: &Joints,
    ) -> LegGeometry<V> {
        let arm = Lanes3::constant(simd, &joints.platform)
            .transformed(&self.pose.rotation, |value| V::spread(simd, value));
        LegGeometry { arm, ..self.legs.load(simd) }
    }

    /// Where the platform is.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// `L_i` \[m\].
    pub fn lengths(&self, machine: &Machine) -> [f64; LEGS] {
        machine.joints.triples.unpack(&self.legs.length)
    }

    /// How near to a singular pose.
    pub fn sensitivity(&self) -> &Sensitivity {
        &self.sensitivity
    }

    /// The twist that gives the measured leg rates, see [`super::inverse_jacobian::twist_from_rates`].
    pub fn twist(&self, machine: &Machine, rates: &[f64; LEGS]) -> Option<Twist> {
        let joints = &machine.joints;
        let rates = joints.triples.pack(rates);
        dispatch!(machine.level, simd => {
            let legs = self.legs.load::<_, f64x8<_>>(simd);
            let balance = Balance::load(simd, joints, &self.factors);
            balance.twist(&legs, Eight::load(simd, &rates)).map(|twist| twist.numbers())
        })
        .map(|twist| joints.twist_of_origin(&twist, &self.pose.rotation))
    }
}
