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

use fearless_simd::{Simd, dispatch};
use nalgebra::{Matrix6, Vector6};

use super::inverse_geometry::{LegAcceleration, LegGeometry, LegVelocity};
use super::inverse_jacobian::leg_wrench_columns;
use super::lanes::Lane;
use super::leg::{Model, leg_reaction};
use super::machine::{LEGS, Machine};
use super::platform::platform_wrench;
use super::rigid::Motion;

/// The six actuator forces Gamma \[N\] for a motion of the platform, `None` at a singular pose.
pub fn inverse_dynamics<M: Model>(machine: &Machine, motion: &Motion) -> Option<[f64; LEGS]> {
    let load = task_load::<M>(machine, motion);
    let gamma = load.leg_wrenches.lu().solve(&load.wrench)?;
    Some((gamma + load.drive_forces).into())
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
    dispatch!(machine.level, simd => task_load_lanes::<_, M>(simd, machine, motion))
}

#[inline(always)]
fn task_load_lanes<S: Simd, M: Model>(simd: S, machine: &Machine, motion: &Motion) -> TaskLoad {
    let legs = LegGeometry::new(simd, machine, &motion.pose);
    let velocity = legs.velocity(simd, &motion.twist);
    let acceleration = legs.acceleration(simd, &motion.twist, &motion.acceleration, &velocity);
    let reaction = leg_reaction::<S, M>(simd, machine, &legs, &velocity, &acceleration);
    let mut wrench = platform_wrench(machine, motion);
    wrench.torque += legs.arm.cross(reaction).sum_legs();
    wrench.force += reaction.sum_legs();
    TaskLoad {
        leg_wrenches: leg_wrench_columns(&legs),
        wrench: wrench.vector(),
        drive_forces: drive_forces(machine, &velocity, &acceleration),
    }
}

#[inline(always)]
fn drive_forces<S: Simd>(
    machine: &Machine,
    velocity: &LegVelocity<S>,
    acceleration: &LegAcceleration<S>,
) -> Vector6<f64> {
    let rate = Vector6::from(Lane::store(velocity.rate).legs());
    let accel = Vector6::from(Lane::store(acceleration.accel).legs());
    rate.zip_map(&accel, |rate, accel| machine.actuator.drive_force(rate, accel))
}
