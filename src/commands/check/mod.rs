//! `hexad check`: the machine of a file at home, in numbers that an engineer can compare with the drawing.

use core::fmt;
use std::path::PathBuf;

use crate::analysis::assembly_modes::{OtherMode, other_modes};
use crate::commands::arguments::MachineFile;
use crate::commands::failure::Failure;
use crate::config::Config;
use crate::config::control_loops::{longest_age_s, loops, timeout_warning};
use crate::model::active_forces::inverse_dynamics;
use crate::model::fidelity::Exact;
use crate::model::inverse_geometry::{leg_directions, leg_lengths};
use crate::model::inverse_jacobian::condition;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::LEGS;
use crate::model::task::TaskState;
use crate::output::files::print;
use crate::output::text_table::{Right, text_table};

mod drawing;

#[derive(Debug, clap::Args)]
pub struct CheckArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Draw the machine at home (SVG): from above, from the side, in perspective, with numbered joints
    #[arg(long, value_name = "FILE")]
    drawing: Option<PathBuf>,
}

impl CheckArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        // First the figures: they are of use where no file can be written.
        print(Check::new(&config))?;
        let Some(path) = self.drawing else { return Ok(()) };
        drawing::write_svg(&path, &config.name, &config.machine)?;
        Ok(print(format_args!("drawing of the machine at home: {}\n", path.display()))?)
    }
}

/// Lengths, forces, conditioning and control loops of a machine at its home pose; displays as text.
pub struct Check<'a> {
    config: &'a Config,
    lengths: [f64; LEGS],
    /// Static forces \[N\]; none at a singular pose.
    forces: Option<[f64; LEGS]>,
    /// Angle between each leg and the first axis of its universal joint \[deg\].
    joint_angles: [f64; LEGS],
    condition: f64,
    /// Largest motion from one measurement to the next for which the pose is certain \[rad\], \[radius\].
    trusted_step: f64,
    /// Other poses with the same lengths, the nearest first.
    others: Vec<OtherMode>,
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
        let kinematic_state = KinematicState::new(machine, motion.pose);
        Self {
            config,
            trusted_step: kinematic_state.sensitivity().trusted_step,
            others: other_modes(machine, &kinematic_state),
            lengths: leg_lengths(machine, &motion.pose),
            forces: inverse_dynamics::<Exact>(machine, &motion),
            joint_angles,
            condition: condition(machine, &motion.pose),
        }
    }
}

impl fmt::Display for Check<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Config { name, machine, .. } = self.config;
        let actuator = &machine.actuator;
        writeln!(f, "{name}: valid. At home, at rest:\n")?;
        let forces = self.forces.unwrap_or([f64::NAN; LEGS]);
        let legs = self.lengths.iter().zip(forces).zip(self.joint_angles).enumerate();
        let header = ["leg", "length", "to shortest", "to longest", "force", "of the limit", "to joint axis"];
        let rows = legs.map(|(leg, ((length, force), angle))| {
            [
                format!("{}", leg + 1),
                format!("{length:.4} m"),
                format!("{:.4} m", length - actuator.min_length),
                format!("{:.4} m", actuator.max_length - length),
                format!("{force:.2} N"),
                format!("{:.1} %", 100.0 * force.abs() / actuator.max_force),
                format!("{angle:.1} deg"),
            ]
        });
        write!(f, "{}", text_table(2, &header.map(|name| (name, Right)), rows))?;
        writeln!(f, "\ncondition of the Jacobian  {:.2}   (1 is best; errors grow with it)", self.condition)?;
        self.fmt_modes(f)?;
        self.fmt_loops(f)
    }
}

impl Check<'_> {
    /// Writes the stability margins of the control loops.
    fn fmt_loops(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let control = &self.config.deployment.control;
        let compensated = if control.compensate_disturbances { "" } else { ", disturbances not compensated" };
        writeln!(
            f,
            "control mode {}, estimator {:.2} Hz{compensated}",
            control.mode.name(),
            control.estimator_bandwidth_hz
        )?;
        if control.mode.acts_on_legs() {
            let legs = &control.leg_masses;
            let root = |gain: f64| gain.sqrt() * control.position_bandwidth_hz;
            writeln!(
                f,
                "legs         coupled, they move with {:.2} to {:.2} Hz",
                root(legs.softest),
                root(legs.stiffest)
            )?;
        }
        let deployment = &self.config.deployment;
        for control_loop in loops(deployment) {
            writeln!(f, "{control_loop}")?;
            if let Some(warning) = control_loop.warning() {
                writeln!(f, "WARNING: {warning}")?;
            }
        }
        writeln!(f, "measurements stable to an age of {:.1} ms", 1e3 * longest_age_s(deployment))?;
        timeout_warning(deployment).map_or(Ok(()), |warning| writeln!(f, "WARNING: {warning}"))
    }

    /// Writes within which bounds start-up and the loop know the pose.
    fn fmt_modes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Config { machine, deployment, .. } = self.config;
        let step_m = self.trusted_step * machine.joints.radius;
        writeln!(
            f,
            "pose certain from cycle to cycle  up to {:.1} mm or {:.2} deg, {:.1} m/s at {:.0} Hz",
            1e3 * step_m,
            self.trusted_step.to_degrees(),
            step_m * deployment.realtime.rate_hz,
            deployment.realtime.rate_hz,
        )?;
        let Some(nearest) = self.others.first() else {
            return writeln!(
                f,
                "other poses with these lengths    none found within 90 deg and 2 radii of home"
            );
        };
        writeln!(f, "other poses with these lengths    {} found, the nearest {nearest}", self.others.len())?;
        if nearest.is_nearby() {
            writeln!(
                f,
                "WARNING: at start-up the lengths alone may not distinguish it from home; choose a home further away from it"
            )?;
        }
        Ok(())
    }
}
