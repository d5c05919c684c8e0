//! The platform at one pose with everything that is worth computing once: its legs and the factorization of
//! `N`. Forward kinematics ends with one; twist, forces, condition and determinant then cost no second one.

use fearless_simd::{Simd, dispatch};

use super::factorization::{Factorization, StoredFactorization};
use super::inverse_geometry::LegGeometry;
use super::lanes3::Lanes3;
use super::machine::{LEGS, Machine};
use super::rigid::{Pose, Twist};
use super::sensitivity::Sensitivity;
use super::triples::LegLanes;

/// One pose, its legs, its factorization.
#[derive(Clone, Copy, Debug)]
pub struct KinematicState {
    pub(super) pose: Pose,
    pub(super) legs: StoredLegs,
    pub(super) factorization: StoredFactorization,
    pub(super) sensitivity: Sensitivity,
}

/// Geometry of the legs in memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoredLegs {
    arm: [LegLanes; 3],
    direction: [LegLanes; 3],
    length: LegLanes,
    inverse_length: LegLanes,
}

impl StoredLegs {
    #[inline(always)]
    pub(super) fn new<S: Simd>(legs: &LegGeometry<S>) -> Self {
        Self {
            arm: legs.arm.store(),
            direction: legs.direction.store(),
            length: legs.length.into(),
            inverse_length: legs.inverse_length.into(),
        }
    }

    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S) -> LegGeometry<S> {
        LegGeometry {
            arm: Lanes3::load(simd, &self.arm),
            direction: Lanes3::load(simd, &self.direction),
            length: self.length.load(simd),
            inverse_length: self.inverse_length.load(simd),
        }
    }
}

impl KinematicState {
    /// At a known pose.
    pub fn new(machine: &Machine, pose: Pose) -> Self {
        let joints = &machine.joints;
        dispatch!(machine.level, simd => {
            let legs = LegGeometry::around_center(simd, joints, &pose);
            let factorization = Factorization::new(simd, joints, &legs);
            Self {
                pose,
                legs: StoredLegs::new(&legs),
                factorization: factorization.store(),
                sensitivity: Sensitivity::new(simd, joints, &legs, &factorization),
            }
        })
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
            let legs = self.legs.load(simd);
            let factorization = Factorization::load(simd, joints, &self.factorization);
            factorization.twist(&legs, rates.load(simd)).map(|twist| twist.first())
        })
        .map(|twist| joints.twist_of_origin(&twist, &self.pose.rotation))
    }
}
