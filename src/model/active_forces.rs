//! Active forces (paper, eq. 94-97): the inverse dynamic model from motion to the six actuator forces.
//!
//! ```text
//! W = [torque; force] of the platform + sum_i [ b_i x F_i ; F_i ]       (97), inside the brackets
//! N Gamma = W                                                           Gamma = J^T W
//! Gamma_i += reflected L''_i + viscous L'_i + coulomb sign(L'_i)        the drives
//! ```
//!
//! Positive forces push the platform away from the base. `Gamma` is linear in the acceleration.
//! Conditioning: relative errors grow with the condition of N, see [`super::inverse_jacobian::condition`].

use fearless_simd::{Simd, dispatch, f64x8};
use nalgebra::{Matrix6, Vector6};

use super::balance::{Balance, wrench_columns};
use super::inverse_geometry::{LegAcceleration, LegGeometry, LegVelocity};
use super::lanes::Eight;
use super::leg::{Model, leg_reaction};
use super::machine::{LEGS, Machine};
use super::platform::platform_wrench;
use super::rigid::{Motion, Wrench};

/// The six actuator forces Gamma \[N\] for a motion of the platform, `None` at a singular pose.
pub fn inverse_dynamics<M: Model>(machine: &Machine, motion: &Motion) -> Option<[f64; LEGS]> {
    dispatch!(machine.level, simd => forces::<_, f64x8<_>, M>(simd, machine, motion))
}

#[inline(always)]
fn forces<S: Simd, V: Eight<S>, M: Model>(simd: S, machine: &Machine, motion: &Motion) -> Option<[f64; LEGS]> {
    let legs = LegGeometry::<V>::new(simd, machine, &motion.pose);
    let (wrench, drive) = load::<S, V, M>(simd, machine, motion, &legs);
    Balance::new(simd, &legs).forces(&machine.joints.triples, &wrench, drive)
}

/// What the actuators have to balance: `N (Gamma - drive_forces) = wrench`.
#[derive(Clone, Copy, Debug)]
pub struct TaskLoad {
    /// N, see [`super::inverse_jacobian::leg_wrenches`].
    pub leg_wrenches: Matrix6<f64>,
    /// W, torque about C first \[N m\], \[N\].
    pub wrench: Vector6<f64>,
    /// What the drives themselves take, per leg \[N\].
    pub drive_forces: Vector6<f64>,
}

/// The load of a motion, before it is shared among the legs.
pub fn task_load<M: Model>(machine: &Machine, motion: &Motion) -> TaskLoad {
    dispatch!(machine.level, simd => {
        let triples = &machine.joints.triples;
        let legs = LegGeometry::<f64x8<_>>::new(simd, machine, &motion.pose);
        let (wrench, drive) = load::<_, _, M>(simd, machine, motion, &legs);
        TaskLoad {
            leg_wrenches: wrench_columns(triples, legs.arm.cross(legs.direction), legs.direction),
            wrench: wrench.vector(),
            drive_forces: triples.unpack(&drive.store()).into(),
        }
    })
}

/// W, and what the drives take.
#[inline(always)]
fn load<S: Simd, V: Eight<S>, M: Model>(
    simd: S,
    machine: &Machine,
    motion: &Motion,
    legs: &LegGeometry<V>,
) -> (Wrench, V) {
    let velocity = legs.velocity(simd, &motion.twist);
    let acceleration = legs.acceleration(simd, &motion.twist, &motion.acceleration, &velocity);
    let reaction = leg_reaction::<S, V, M>(simd, machine, legs, &velocity, &acceleration);
    let mut wrench = platform_wrench(machine, motion);
    wrench.torque += legs.arm.cross(reaction).sum_legs();
    wrench.force += reaction.sum_legs();
    (wrench, drive_forces(simd, machine, &velocity, &acceleration))
}

/// `reflected L'' + viscous L' + coulomb sign(L')`, the sign proportional below the smoothing speed.
#[inline(always)]
fn drive_forces<S: Simd, V: Eight<S>>(
    simd: S,
    machine: &Machine,
    velocity: &LegVelocity<V>,
    acceleration: &LegAcceleration<V>,
) -> V {
    let actuator = &machine.actuator;
    let splat = |value: f64| V::splat(simd, value);
    let sign = (velocity.rate * splat(1.0 / actuator.coulomb_smoothing)).max(splat(-1.0)).min(splat(1.0));
    let friction = splat(actuator.viscous_friction).mul_add(velocity.rate, splat(actuator.coulomb_friction) * sign);
    splat(actuator.reflected_mass).mul_add(acceleration.accel, friction)
}
