//! Accelerations and velocities that the drives of a machine can give at a pose.
//!
//! With the forces of [`PoseEvaluator::leg_loads`] for 1 m/s^2 and 1 rad/s^2, and a usable force F:
//!
//! ```text
//! holding_i + a linear_i + w angular_i <= F        |v| <= rate        |omega| |b_i x n_i| <= rate
//! ```
//!
//! for every leg i, in every direction. Each of these forces is attained, so the results are the largest. Forces of velocities are
//! not included: leave room for them in F.

use super::pose_quality::{AccelerationDemand, LegLoad, PoseEvaluator};
use crate::model::LEGS;
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::machine::Machine;
use crate::model::rigid::Pose;

/// Drives of a machine at one pose.
///
/// ```
/// use hexad::analysis::drive_capability::DriveCapability;
/// # let machine = hexad::config::Config::load("config/motion_base.toml".as_ref()).unwrap().machine;
/// let drives = DriveCapability::new(&machine, &machine.home_pose()).unwrap();
/// let force = machine.actuator.max_force;
/// // What one acceleration takes, the other lacks.
/// assert!(drives.angular_acceleration(force, 5.0) < drives.angular_acceleration(force, 0.0));
/// assert!(drives.hardest_held().1 < force);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DriveCapability {
    /// For 1 m/s^2 and 1 rad/s^2.
    loads: [LegLoad; LEGS],
    /// Rate of the fastest leg at 1 rad/s about its worst axis \[m\].
    largest_arm: f64,
    max_rate: f64,
}

impl DriveCapability {
    /// Drives at a pose; `None` where it is singular.
    pub fn new(machine: &Machine, pose: &Pose) -> Option<Self> {
        let unit = AccelerationDemand { linear: 1.0, angular: 1.0 };
        let loads = PoseEvaluator::new(machine, unit).leg_loads(pose)?;
        let wrenches = leg_wrenches(machine, pose);
        let arms = wrenches.column_iter().map(|wrench| wrench.fixed_rows::<3>(0).norm());
        Some(Self { loads, largest_arm: arms.fold(0.0, f64::max), max_rate: machine.actuator.max_rate })
    }

    /// The leg that needs the largest force at rest, counted from 0, and that force \[N\].
    pub fn hardest_held(&self) -> (usize, f64) {
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
    pub fn linear_acceleration(&self, force: f64, angular: f64) -> f64 {
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
