//! Accelerations and velocities that the drives of a machine can give at a pose.
//!
//! With the forces of [`DriveLoads`] in the worst direction, and a usable force F:
//!
//! ```text
//! holding_i + a linear_i + w angular_i <= F        |v| <= rate        |omega| |b_i x n_i| <= rate
//! ```
//!
//! for every leg i, in every direction. Each of these forces is attained, so the results are the largest. Forces of velocities are
//! not included: leave room for them in F.

use nalgebra::Vector6;

use super::gravity_cone::GravityCone;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::drive_loads::DriveLoads;
use hexad_core::model::inverse_jacobian::leg_wrenches;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::Pose;

/// Drives of a machine at one pose.
///
/// ```
/// use hexad_machine::analysis::drive_capability::DriveCapability;
/// # let machine = hexad_machine::config::Config::load("../../config/motion_base.toml".as_ref()).unwrap().machine;
/// let drives = DriveCapability::new(&machine, &machine.home_pose()).unwrap();
/// let force = machine.actuator.weakest_available_force_n();
/// // What one acceleration takes, the other lacks.
/// assert!(drives.angular_acceleration(force, 5.0) < drives.angular_acceleration(force, 0.0));
/// assert!(drives.largest_holding_force().1 < force);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DriveCapability {
    /// For 1 m/s^2 and 1 rad/s^2.
    loads: [LegLoad; LEGS],
    /// Rate of the fastest leg at 1 rad/s about its worst axis \[m\].
    largest_arm: f64,
    max_rate: f64,
}

/// Largest force of a leg around a pose at rest, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct LegLoad {
    /// Holding the platform, with Coulomb's friction \[N\].
    holding: f64,
    /// Per unit of the acceleration of C in the worst direction \[kg\].
    linear: f64,
    /// Per unit of the angular acceleration about the worst axis \[N s^2\].
    angular: f64,
}

impl DriveCapability {
    /// Drives at a pose; `None` where it is singular.
    pub fn new(machine: &Machine, pose: &Pose) -> Option<Self> {
        Self::of(&InverseDynamics::new(machine), pose)
    }

    /// Drives of a model at a pose; `None` where it is singular.
    pub fn of(dynamics: &InverseDynamics, pose: &Pose) -> Option<Self> {
        let machine = dynamics.machine();
        let found = DriveLoads::new(dynamics, pose)?;
        let [ax, ay, az, x, y, z] = found.by_acceleration(machine).map(Vector6::from);
        let norms = |a: &Vector6<f64>, b: &Vector6<f64>, c: &Vector6<f64>| -> [f64; LEGS] {
            (a.component_mul(a) + b.component_mul(b) + c.component_mul(c)).map(f64::sqrt).into()
        };
        let mut loads = [LegLoad::default(); LEGS];
        let holding = found.holding(machine).into_iter().zip(&machine.actuator.coulomb_friction_n);
        for (load, (force, friction)) in loads.iter_mut().zip(holding) {
            load.holding = force.abs() + friction;
        }
        let directions = norms(&ax, &ay, &az).into_iter().zip(norms(&x, &y, &z));
        for (load, (angular, linear)) in loads.iter_mut().zip(directions) {
            (load.angular, load.linear) = (angular, linear);
        }
        let wrenches = leg_wrenches(machine, pose);
        let arms = wrenches.column_iter().map(|wrench| wrench.fixed_rows::<3>(0).norm());
        Some(Self { loads, largest_arm: arms.fold(0.0, f64::max), max_rate: machine.actuator.max_rate_m_s })
    }

    /// Drives of a model at a pose under gravity in any direction of a cone; `None` where the pose is singular.
    pub fn in_cone(dynamics: &InverseDynamics, pose: &Pose, cone: &GravityCone) -> Option<Self> {
        let mut found = Self::of(dynamics, pose)?;
        let forces = cone.holding(dynamics, pose)?.into_iter();
        let legs = found.loads.iter_mut().zip(forces.zip(&dynamics.machine().actuator.coulomb_friction_n));
        legs.for_each(|(load, (force, friction))| load.holding = force + friction);
        Some(found)
    }

    /// The leg that needs the largest force at rest, counted from 0, and that force \[N\].
    pub fn largest_holding_force(&self) -> (usize, f64) {
        let forces = self.loads.iter().map(|leg| leg.holding).enumerate();
        forces.fold((0, 0.0), |most, leg| if leg.1 > most.1 { leg } else { most })
    }

    /// Forces of the leg with the largest sum \[N\]: holding, and under a linear and an angular acceleration in any direction.
    pub fn largest_forces(&self, linear: f64, angular: f64) -> [f64; 3] {
        let forces = self.loads.iter().map(|leg| [leg.holding, linear * leg.linear, angular * leg.angular]);
        let sum = |forces: &[f64; 3]| forces.iter().sum::<f64>();
        forces.max_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap_or_default()
    }

    /// Largest acceleration of C in any direction with `force` \[N\], together with an angular one in any direction \[m/s^2\].
    pub fn max_linear_acceleration(&self, force: f64, angular: f64) -> f64 {
        least(self.loads.iter().map(|leg| (force - leg.holding - angular * leg.angular) / leg.linear))
    }

    /// Largest angular acceleration about any axis with `force` \[N\], together with a linear one in any direction \[rad/s^2\].
    pub fn angular_acceleration(&self, force: f64, linear: f64) -> f64 {
        least(self.loads.iter().map(|leg| (force - leg.holding - linear * leg.linear) / leg.angular))
    }

    /// Largest velocity of C in any direction \[m/s\].
    pub fn velocity(&self) -> f64 {
        self.max_rate
    }

    /// Largest angular velocity about any axis \[rad/s\].
    pub fn angular_velocity(&self) -> f64 {
        self.max_rate / self.largest_arm
    }
}

fn least(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, f64::min)
}
