//! `hexad check`: what a machine file means, in numbers an engineer can compare with the drawing.

extern crate std;

use core::f64::consts::TAU;
use core::fmt;
use std::prelude::rust_2024::*;

use super::config::Config;
use crate::control::gains::{gain_margin, max_bandwidth_hz};
use crate::model::active_forces::inverse_dynamics;
use crate::model::inverse_geometry::{leg_directions, leg_lengths};
use crate::model::inverse_jacobian::condition;
use crate::model::ladder::Exact;
use crate::model::machine::LEGS;
use crate::model::task::TaskState;

/// The machine at its home pose.
pub struct Check<'a> {
    config: &'a Config,
    lengths: [f64; LEGS],
    /// Static forces; none at a singular pose.
    forces: Option<[f64; LEGS]>,
    /// Angle between each leg and the first axis of its universal joint \[deg\].
    joint_angles: [f64; LEGS],
    condition: f64,
}

impl<'a> Check<'a> {
    /// Evaluates the model at home, at rest.
    pub fn new(config: &'a Config) -> Self {
        let machine = &config.machine;
        let motion = TaskState::at_rest(machine.home).motion();
        let joints = &machine.joints;
        let axes = joints.triples.unpack_vectors(&joints.universal_axis);
        let directions = leg_directions(machine, &motion.pose);
        let mut joint_angles = [0.0; LEGS];
        for (angle, (u, n)) in joint_angles.iter_mut().zip(axes.iter().zip(&directions)) {
            *angle = u.cross(n).norm().atan2(u.dot(n)).to_degrees();
        }
        Self {
            config,
            lengths: leg_lengths(machine, &motion.pose),
            forces: inverse_dynamics::<Exact>(machine, &motion),
            joint_angles,
            condition: condition(machine, &motion.pose),
        }
    }
}

impl fmt::Display for Check<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Config { name, machine, deployment } = self.config;
        let actuator = &machine.actuator;
        writeln!(f, "{name}: valid. At home, at rest:\n")?;
        writeln!(f, "leg   length      to shortest  to longest   force        of the limit  to joint axis")?;
        let forces = self.forces.unwrap_or([f64::NAN; LEGS]);
        for (leg, ((length, force), angle)) in
            self.lengths.iter().zip(forces).zip(self.joint_angles).enumerate()
        {
            writeln!(
                f,
                "{:>3}   {length:>7.4} m   {:>7.4} m    {:>7.4} m   {force:>9.2} N   {:>7.1} %     {angle:>7.1} deg",
                leg + 1,
                length - actuator.min_length,
                actuator.max_length - length,
                100.0 * force.abs() / actuator.max_force,
            )?;
        }
        writeln!(f, "\ncondition of the Jacobian  {:.2}   (1 is best; errors grow with it)", self.condition)?;
        let period = deployment.realtime.period_s();
        let control = &deployment.control;
        for (what, bandwidth, damping) in [
            ("position", control.position_bandwidth_hz, control.position_damping_ratio),
            ("orientation", control.orientation_bandwidth_hz, control.orientation_damping_ratio),
        ] {
            writeln!(
                f,
                "{what:<12} bandwidth {bandwidth:>6.2} Hz at {:.0} Hz: wn T = {:.3}, gain margin {:.2}, at most {:.2} Hz",
                deployment.realtime.rate_hz,
                TAU * bandwidth * period,
                gain_margin(bandwidth, damping, period),
                max_bandwidth_hz(damping, period),
            )?;
        }
        Ok(())
    }
}
