//! Forces that hold the platform under gravity in any direction of a cone: a telescope that tips, a machine to be mounted otherwise.
//!
//! At a pose at rest the force of a leg is linear in gravity, `r . g`. Over all g at most `t` from `g0`, as long as it:
//!
//! ```text
//! u = g0 / |g0|    a = r . u    b = |r - a u|
//! largest |r . g| = |g0| |r|                          where atan2(b, |a|) <= t: g along r
//!                 = |g0| (|a| cos t + b sin t)        elsewhere: g on the cone, next to r
//! ```
//!
//! Exact, so no direction is sampled. The direction changes slowly: forces of a base that turns or accelerates are not included.

use core::fmt;

use nalgebra::Vector3;
use serde::Serialize;

use crate::text::numbers::{AXES, axis_unit, significant};
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::drive_loads::DriveLoads;
use hexad_core::model::fidelity::Gravity;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::{Acceleration, Motion, Pose, Twist};
use hexad_core::model::task::TaskState;

/// Directions of gravity around that of the machine file.
///
/// ```
/// use hexad_machine::analysis::gravity_cone::GravityCone;
/// use nalgebra::Vector3;
/// // 8 kg along z and 6 kg along x, under 10 m/s^2 along z, then under 10 m/s^2 in any direction.
/// let (row, gravity) = (Vector3::new(6.0, 0.0, 8.0), Vector3::z() * 10.0);
/// let force = |half_angle_rad| row.dot(&GravityCone::new(gravity, half_angle_rad).worst(&row));
/// assert!((force(0.0) - 80.0).abs() < 1e-12 && (force(2.0) - 100.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GravityCone {
    axis: Vector3<f64>,
    half_angle_rad: f64,
}

/// Largest force that a leg needs to hold the platform at rest, over poses and directions of gravity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstHolding {
    /// Leg, from 1.
    pub leg: usize,
    /// Force with Coulomb's friction \[N\].
    pub force_n: f64,
    /// Its share of what the drive gives.
    pub force_ratio: f64,
    /// Gravity, base axes \[m/s^2\].
    pub gravity_m_s2: [f64; 3],
    /// X.
    pub pose: [f64; 6],
}

/// Forces of a machine under gravity in any direction of a cone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ConeHolding {
    /// Largest angle from the file's gravity.
    pub half_angle_rad: f64,
    /// At home.
    pub at_home: Option<WorstHolding>,
    /// Hardest pose: of `[envelope]`, the largest of many poses; of a map, of its usable poses.
    pub hardest: Option<WorstHolding>,
}

impl GravityCone {
    /// Cone around a gravity, in base axes.
    pub fn new(gravity_m_s2: Vector3<f64>, half_angle_rad: f64) -> Self {
        Self { axis: gravity_m_s2, half_angle_rad }
    }

    /// Gravity of the cone under which `|row . g|` is largest, in base axes \[m/s^2\].
    pub fn worst(&self, row: &Vector3<f64>) -> Vector3<f64> {
        let length = self.axis.norm();
        let Some(axis) = self.axis.try_normalize(0.0) else { return self.axis };
        let along = row.dot(&axis);
        let row = if along < 0.0 { -row } else { *row };
        let across = row - axis * along.abs();
        match across.try_normalize(0.0) {
            Some(across_axis) if self.half_angle_rad > 0.0 => {
                let angle = across.norm().atan2(along.abs()).min(self.half_angle_rad);
                (axis * angle.cos() + across_axis * angle.sin()) * length
            }
            _ => self.axis,
        }
    }

    /// Largest force of each leg at rest, without friction \[N\]; `None` at a singular pose.
    pub fn holding(&self, dynamics: &InverseDynamics, pose: &Pose) -> Option<[f64; LEGS]> {
        if self.half_angle_rad == 0.0 {
            let rest = Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() };
            return Some(dynamics.forces_under::<Gravity>(&rest, &self.axis)?.map(f64::abs));
        }
        Some(DriveLoads::holding_rows(dynamics, pose)?.map(|row| row.dot(&self.worst(&row)).abs()))
    }

    /// The leg that needs the largest force at rest, counted from 0, and that force with Coulomb's friction \[N\]; `None` at a singular pose.
    pub fn largest_holding_force(&self, dynamics: &InverseDynamics, pose: &Pose) -> Option<(usize, f64)> {
        let forces = self.holding(dynamics, pose)?.into_iter();
        let legs = forces.zip(dynamics.machine().actuator.coulomb_friction_n).enumerate();
        let legs = legs.map(|(leg, (force, friction))| (leg, force + friction));
        Some(legs.fold((0, 0.0), |most, leg| if leg.1 > most.1 { leg } else { most }))
    }

    /// Largest force over poses at rest, given by X. Singular poses have none.
    pub fn worst_holding(
        &self,
        machine: &Machine,
        poses: impl IntoIterator<Item = [f64; 6]>,
    ) -> Option<WorstHolding> {
        let (dynamics, available) =
            (InverseDynamics::new(machine), machine.actuator.weakest_available_force_n());
        let legs = |pose: [f64; 6]| {
            let rows = DriveLoads::holding_rows(&dynamics, &TaskState::at_rest(pose).motion().pose)?;
            let legs = (1..).zip(rows).zip(machine.actuator.coulomb_friction_n);
            legs.map(|((leg, row), friction)| {
                let gravity = self.worst(&row);
                let force_n = row.dot(&gravity).abs() + friction;
                let force_ratio = force_n / available;
                WorstHolding { leg, force_n, force_ratio, gravity_m_s2: gravity.into(), pose }
            })
            .max_by(|a, b| a.force_n.total_cmp(&b.force_n))
        };
        poses.into_iter().filter_map(legs).max_by(|a, b| a.force_n.total_cmp(&b.force_n))
    }
}

impl fmt::Display for WorstHolding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.gravity_m_s2.map(significant);
        let (leg, force, percent) = (self.leg, significant(self.force_n), 100.0 * self.force_ratio);
        write!(f, "leg {leg} needs {force} N, {percent:.0} % of the limit, with gravity [{x}, {y}, {z}] m/s2")
    }
}

impl fmt::Display for ConeHolding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let angle = significant(self.half_angle_rad.to_degrees());
        write!(f, "gravity anywhere within {angle} deg of the file's:")?;
        if let Some(worst) = &self.at_home {
            write!(f, "\n  at home {worst}")?;
        }
        let Some(worst) = &self.hardest else { return Ok(()) };
        write!(f, "\n  hardest pose: {worst},\n    at")?;
        for (axis, (name, value)) in AXES.into_iter().zip(worst.pose).enumerate() {
            let (scale, unit) = axis_unit(axis);
            let comma = if axis > 0 { "," } else { "" };
            write!(f, "{comma} {name} {} {unit}", significant(scale * value))?;
        }
        Ok(())
    }
}
