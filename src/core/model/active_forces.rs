//! Active forces (paper, eq. 94-97): inverse dynamic model from a motion to the six actuator forces.
//!
//! ```text
//! W = [torque; force] of the platform + sum_i [ b_i x F_i ; F_i ]       (97), inside the brackets
//! N Gamma = W                                                           Gamma = J^T W
//! Gamma_i += reflected L''_i + viscous L'_i + coulomb sign(L'_i)        the drives
//! ```
//!
//! The actuator of leg i alone balances the part of `F_i` along the leg, so only the transverse part enters
//! W.
//!
//! Positive forces push the platform away from the base. `Gamma` is linear in the acceleration.
//! Conditioning: relative errors grow with the condition of N, see [`super::inverse_jacobian::condition`].

use fearless_simd::{Simd, dispatch, f64x8, prelude::*};
use nalgebra::{Matrix6, Vector3, Vector6};

use super::LEGS;
use super::factorization::{Factorization, LaneWrench, wrench_columns};
use super::fidelity::{Fidelity, ModelTerms, with_terms};
use super::inverse_geometry::LegGeometry;
use super::lanes::LaneArithmetic as _;
use super::lanes3::Lanes3;
use super::leg::{ForceOnLeg, JointForces, LegConstants};
use super::machine::{Joints, Machine};
use super::platform::{PrincipalAxes, acceleration_map};
use super::rigid::{Acceleration, Motion, Twist};
use super::triples::LegLanes;

/// Inverse dynamic model of one machine: from a motion of the platform to the six actuator forces.
///
/// ```
/// use hexad_core::model::{active_forces::InverseDynamics, fidelity::Exact, inverse_jacobian::leg_wrenches};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let model = InverseDynamics::new(&machine);
/// let rest = hexad_core::model::task::TaskState::at_rest(machine.home).motion();
/// let forces = model.forces::<Exact>(&rest).unwrap();
/// // At rest the legs carry at least the platform, and the rest of the weight stands on the base joints.
/// let wrench = leg_wrenches(&machine, &rest.pose) * nalgebra::Vector6::from(forces);
/// let lifted = -wrench.fixed_rows::<3>(3).dot(&machine.gravity_m_s2.normalize());
/// assert!(lifted > machine.platform.mass_kg * machine.gravity_m_s2.norm());
/// ```
#[derive(Clone, Debug)]
pub struct InverseDynamics {
    machine: Machine,
    joints: Joints,
    legs: LegConstants,
    axes: PrincipalAxes,
    /// Viscous and Coulomb friction of the legs.
    viscous_friction: LegLanes,
    coulomb_friction: LegLanes,
    /// Inverse of the smoothing speed of Coulomb friction \[s/m\].
    inverse_smoothing: f64,
}

/// Load of one motion on the actuators: `N (Gamma - axial_forces_n) = wrench`.
#[derive(Clone, Copy, Debug)]
pub struct TaskLoad {
    /// Matrix N, see [`super::inverse_jacobian::leg_wrenches`].
    pub leg_wrenches: Matrix6<f64>,
    /// W without the axial forces; torque about C \[N m\], then force \[N\].
    pub wrench: Vector6<f64>,
    /// Load along each leg, drive included \[N\].
    pub axial_forces_n: Vector6<f64>,
}

impl TaskLoad {
    /// Whole load as a wrench about C \[N m\], \[N\]: `W + N axial_forces_n`.
    pub fn total(&self) -> Vector6<f64> {
        self.wrench + self.leg_wrenches * self.axial_forces_n
    }
}

impl InverseDynamics {
    /// Computes the constants of the model. Not for the cycle: it decomposes the inertia tensor.
    pub fn new(machine: &Machine) -> Self {
        let (actuator, triples) = (&machine.actuator, &machine.joints.triples);
        Self {
            joints: machine.joints.with_point(&machine.platform.center_of_mass_m),
            legs: LegConstants::new(machine),
            axes: PrincipalAxes::new(machine),
            viscous_friction: triples.pack(&actuator.viscous_friction_n_s_m),
            coulomb_friction: triples.pack(&actuator.coulomb_friction_n),
            inverse_smoothing: 1.0 / actuator.coulomb_smoothing_m_s,
            machine: machine.clone(),
        }
    }

    /// Machine that this model describes.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Joints, with the platform's centre of mass in the padding.
    pub(super) fn joints(&self) -> &Joints {
        &self.joints
    }

    /// Actuator forces Gamma \[N\] for a motion of the platform; `None` at a singular pose.
    pub fn forces<M: ModelTerms>(&self, motion: &Motion) -> Option<[f64; LEGS]> {
        self.forces_under::<M>(motion, &self.machine.gravity_m_s2)
    }

    /// Actuator forces as by [`InverseDynamics::forces`] with another gravity, in base axes: of a base that stands otherwise, or, less its
    /// acceleration, of one that moves along a line.
    pub fn forces_under<M: ModelTerms>(
        &self,
        motion: &Motion,
        gravity_m_s2: &Vector3<f64>,
    ) -> Option<[f64; LEGS]> {
        let lane = dispatch!(self.machine.level, simd => self.balanced::<_, M>(simd, motion, gravity_m_s2))?;
        Some(self.joints.triples.unpack(&lane))
    }

    /// Actuator forces as by [`InverseDynamics::forces`], with a fidelity chosen at run time.
    pub fn forces_of(&self, fidelity: Fidelity, motion: &Motion) -> Option<[f64; LEGS]> {
        with_terms!(fidelity, M => self.forces::<M>(motion))
    }

    /// Actuator forces in lanes. Code for the generic instruction set sorts them, one load after another.
    /// With AVX-512 the compiler would use a gather, which waits until its operands are in the cache.
    #[inline(always)]
    fn balanced<S: Simd, M: ModelTerms>(
        &self,
        simd: S,
        motion: &Motion,
        gravity_m_s2: &Vector3<f64>,
    ) -> Option<LegLanes> {
        let legs = LegGeometry::new(simd, &self.joints, &motion.pose);
        let factorization = Factorization::new(simd, &self.joints, &legs);
        let (wrench, axial) = self.load::<_, M>(simd, motion, gravity_m_s2, &legs);
        factorization.forces(&legs, &wrench, axial)
    }

    /// Load of a motion, before solving for the six forces.
    pub fn load_of<M: ModelTerms>(&self, motion: &Motion) -> TaskLoad {
        self.load_under::<M>(motion, &self.machine.gravity_m_s2)
    }

    /// Load as by [`InverseDynamics::load_of`] with another gravity, in base axes.
    pub fn load_under<M: ModelTerms>(&self, motion: &Motion, gravity_m_s2: &Vector3<f64>) -> TaskLoad {
        dispatch!(self.machine.level, simd => {
            let triples = &self.joints.triples;
            let legs = LegGeometry::new(simd, &self.joints, &motion.pose);
            let (wrench, axial) = self.load::<_, M>(simd, motion, gravity_m_s2, &legs);
            TaskLoad {
                leg_wrenches: wrench_columns(triples, &legs),
                wrench: wrench.sum().vector(),
                axial_forces_n: triples.unpack(&axial.into()).into(),
            }
        })
    }

    /// W and the axial load. The arms of the legs, the acceleration and W refer to the same point of the
    /// platform.
    #[inline(always)]
    pub(super) fn load<S: Simd, M: ModelTerms>(
        &self,
        simd: S,
        motion: &Motion,
        gravity_m_s2: &Vector3<f64>,
        legs: &LegGeometry<S>,
    ) -> (LaneWrench<S>, f64x8<S>) {
        let velocity = legs.velocity(simd, &motion.twist);
        // Terms that the fidelity omits are evaluated as for a platform at rest.
        let twist = if M::VELOCITY { motion.twist } else { Twist::default() };
        let acceleration = if M::ACCELERATION { motion.acceleration } else { Acceleration::default() };
        let map = acceleration_map(&twist, &acceleration);
        let joint_acceleration = legs.joint_acceleration(simd, &acceleration, &map);
        let universal_axis = Lanes3::load(simd, &self.machine.joints.universal_axis);
        let accelerations = [joint_acceleration, Lanes3::splat(simd, gravity_m_s2)];
        let reaction = ForceOnLeg::new::<M>(simd, &self.legs, universal_axis, legs, &velocity, accelerations);
        let mut wrench = LaneWrench {
            torque: legs.arm.cross(reaction.transverse).folded(),
            force: reaction.transverse.folded(),
        };
        if !M::ACCELERATION {
            return (wrench, reaction.axial_n);
        }
        wrench.torque = wrench.torque + self.axes.torques(simd, &motion.pose.rotation, &map);
        let mut accel = legs.direction.dot(joint_acceleration);
        if M::VELOCITY {
            accel = legs.accel(&velocity, joint_acceleration);
        }
        let friction = [self.viscous_friction, self.coulomb_friction].map(|lanes| lanes.load(simd));
        (wrench, reaction.axial_n + self.drive_force(simd, friction, velocity.rate_m_s, accel))
    }

    /// Forces of the platform and the drives on each leg, per unit of the acceleration of its joint along x, y
    /// and z, from rest.
    #[inline(always)]
    pub(super) fn joint_masses<S: Simd>(&self, simd: S, legs: &LegGeometry<S>) -> [JointForces<S>; 3] {
        let reflected = legs.direction * f64x8::splat(simd, self.machine.actuator.reflected_mass_kg);
        let [mut x, mut y, mut z] = self.legs.joint_masses(simd, &self.machine, legs);
        x.axial_n += reflected.x;
        y.axial_n += reflected.y;
        z.axial_n += reflected.z;
        [x, y, z]
    }

    /// Constants of the legs.
    pub(super) fn leg_constants(&self) -> &LegConstants {
        &self.legs
    }

    /// Viscous and Coulomb friction of the legs.
    pub(super) fn friction(&self) -> [&LegLanes; 2] {
        [&self.viscous_friction, &self.coulomb_friction]
    }

    /// Principal axes of the platform.
    pub(super) fn axes(&self) -> &PrincipalAxes {
        &self.axes
    }

    /// Drive force `reflected L'' + viscous L' + coulomb sign(L')`; the sign is proportional below the
    /// smoothing speed.
    #[inline(always)]
    pub(super) fn drive_force<S: Simd>(
        &self,
        simd: S,
        [viscous, coulomb]: [f64x8<S>; 2],
        rate_m_s: f64x8<S>,
        accel_m_s2: f64x8<S>,
    ) -> f64x8<S> {
        let splat = |value: f64| f64x8::splat(simd, value);
        let one = splat(1.0);
        let sign = (rate_m_s * splat(self.inverse_smoothing)).max(-one).min(one);
        let friction = viscous.fused_mul_add(rate_m_s, coulomb * sign);
        splat(self.machine.actuator.reflected_mass_kg).fused_mul_add(accel_m_s2, friction)
    }
}

/// Actuator forces \[N\] of one motion. It computes the constants anew; use an [`InverseDynamics`] for more
/// than one motion.
pub fn inverse_dynamics<M: ModelTerms>(machine: &Machine, motion: &Motion) -> Option<[f64; LEGS]> {
    InverseDynamics::new(machine).forces::<M>(motion)
}
