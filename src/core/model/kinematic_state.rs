//! Kinematic state of the platform: a pose with its legs and the factorization of `N`, computed once.
//!
//! Forward kinematics ends with a kinematic state, so twist, condition and determinant need no second
//! factorization. The arms of the legs start at the mean of the joints on the platform, so that nothing
//! depends on the choice of C.

use fearless_simd::{Simd, dispatch};
use serde::{Deserialize, Serialize};

use super::LEGS;
use super::factorization::{Factorization, StoredFactorization};
use super::inverse_geometry::LegGeometry;
use super::lanes3::Lanes3;
use super::machine::Machine;
use super::rigid::{Pose, Twist};
use super::sensitivity::Sensitivity;
use super::triples::LegLanes;

/// Kinematic state of the platform: a pose with its legs, the factorization of N and the sensitivity.
///
/// ```
/// use hexad_core::model::{inverse_geometry::leg_lengths, kinematic_state::KinematicState};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let home = KinematicState::new(&machine, machine.home_pose());
/// let mut pairs = home.lengths(&machine).into_iter().zip(leg_lengths(&machine, home.pose()));
/// assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-14));
/// assert!(home.sensitivity().condition < 100.0, "legs hold the platform in every direction");
/// ```
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct KinematicState {
    pub(super) pose: Pose,
    pub(super) legs: StoredLegs,
    pub(super) factorization: StoredFactorization,
    pub(super) sensitivity: Sensitivity,
}

/// Geometry of the legs in memory.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
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
            length: legs.length_m.into(),
            inverse_length: legs.inverse_length_per_m.into(),
        }
    }

    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S) -> LegGeometry<S> {
        LegGeometry {
            arm: Lanes3::load(simd, &self.arm),
            direction: Lanes3::load(simd, &self.direction),
            length_m: self.length.load(simd),
            inverse_length_per_m: self.inverse_length.load(simd),
        }
    }
}

impl KinematicState {
    /// Computes the kinematic state at a pose.
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

    /// Pose of the platform.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Leg lengths `L_i` \[m\].
    pub fn lengths(&self, machine: &Machine) -> [f64; LEGS] {
        machine.joints.triples.unpack(&self.legs.length)
    }

    /// Condition, determinant and trusted step at the pose.
    pub fn sensitivity(&self) -> &Sensitivity {
        &self.sensitivity
    }

    /// Twist of the platform for measured leg rates, see [`super::inverse_jacobian::twist_from_rates`].
    pub fn twist(&self, machine: &Machine, rates_m_s: &[f64; LEGS]) -> Option<Twist> {
        let joints = &machine.joints;
        let rates = joints.triples.pack(rates_m_s);
        dispatch!(machine.level, simd => {
            let legs = self.legs.load(simd);
            let factorization = Factorization::load(simd, joints, &self.factorization);
            factorization.twist(&legs, rates.load(simd)).map(|twist| twist.first())
        })
        .map(|twist| joints.twist_of_origin(&twist, &self.pose.rotation))
    }
}
