//! `hexad inverse-dynamics`: actuator forces and leg motions of the rows of a file.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::arguments::{MachineFile, TableFiles};
use super::failure::Failure;
use super::offline_tables::{UnsolvedRows, read_trajectory, task_state, time};
use super::progress::item_bar;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::inverse_geometry::leg_motion;
use hexad_core::model::joint_space::{LegDynamics, joint_space};
use hexad_core::model::machine::Machine;
use hexad_core::model::transmission::Transmission;
use hexad_machine::analysis::batch;
use hexad_machine::text::csv_table::{NumberTable, legs};
use hexad_machine::text::csv_writer::CsvWriter;

#[derive(Debug, Args)]
pub struct InverseDynamicsArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    files: TableFiles,
    /// Fidelity of the dynamic model
    #[arg(long = "model", value_name = "MODEL", default_value = Fidelity::Exact.name(), value_parser = fidelity_by_name())]
    fidelity: Fidelity,
    /// Adds each leg in joint coordinates (beta, gamma, length): diagonal of M, C + G, accelerations, and contact force phi on
    /// the platform, base axes; exact model
    #[arg(long, conflicts_with = "fidelity")]
    joint_space: bool,
}

/// Name of six columns, and the value of a leg.
type JointColumn = (&'static str, fn(&LegDynamics) -> f64);

/// Columns of `--joint-space`.
const JOINT_SPACE: [JointColumn; 11] = [
    ("joint_mass_beta", |leg| leg.mass.x),
    ("joint_mass_gamma", |leg| leg.mass.y),
    ("joint_mass_length", |leg| leg.mass.z),
    ("joint_bias_beta", |leg| leg.bias.x),
    ("joint_bias_gamma", |leg| leg.bias.y),
    ("joint_bias_length", |leg| leg.bias.z),
    ("joint_accel_beta", |leg| leg.accel.x),
    ("joint_accel_gamma", |leg| leg.accel.y),
    ("contact_force_x", |leg| leg.contact_force_n.x),
    ("contact_force_y", |leg| leg.contact_force_n.y),
    ("contact_force_z", |leg| leg.contact_force_n.z),
];

impl InverseDynamicsArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let machine = self.machine.load()?.machine;
        let TableFiles { input, rotation, group, .. } = &self.files;
        let table = read_trajectory(input, group.as_deref(), *rotation, &machine.home)?;
        let (mut output, result) = inverse_dynamics(&machine, self.fidelity, self.joint_space, &table);
        output.save(&self.files.output).map_err(Failure::before_start)?;
        Ok(result?)
    }
}

fn fidelity_by_name() -> impl TypedValueParser<Value = Fidelity> {
    PossibleValuesParser::new(Fidelity::ALL.map(Fidelity::name))
        .map(|name| Fidelity::by_name(&name).unwrap_or(Fidelity::Exact))
}

/// Forces of the legs, lengths and their derivatives, and commands of the drives for a table with the columns of a trajectory, and
/// whether all rows are solved. At a singular pose the forces are NaN. `is_joint_space`: the columns of `JOINT_SPACE` follow, NaN for a leg along its universal axis.
pub fn inverse_dynamics(
    machine: &Machine,
    fidelity: Fidelity,
    is_joint_space: bool,
    table: &NumberTable,
) -> (CsvWriter, Result<(), UnsolvedRows>) {
    let added = if is_joint_space { &JOINT_SPACE[..] } else { &[] };
    let mut columns = vec!["t".into()];
    let stems = ["force", "length", "length_rate", "length_accel", "drive_command"].into_iter();
    columns.extend(stems.chain(added.iter().map(|(stem, _)| *stem)).flat_map(legs));
    let motions: Vec<_> = table.rows().iter().map(|row| task_state(row).motion()).collect();
    let mut forces = vec![None; motions.len()];
    let bar = item_bar(motions.len(), "rows");
    batch::forces(&InverseDynamics::new(machine), fidelity, &motions, &mut forces, 0, &bar);
    bar.finish_and_clear();
    let mut writer = CsvWriter::new(&columns);
    let mut unsolved = UnsolvedRows::new(if is_joint_space {
        "are at singular poses, or have a leg along its universal axis"
    } else {
        "are at singular poses and have no forces"
    });
    for (row, (motion, forces)) in table.rows().iter().zip(motions.iter().zip(forces)) {
        let (forces, motions) = (forces.unwrap_or([f64::NAN; LEGS]), leg_motion(machine, motion));
        let dynamics = joint_space(machine, motion, &forces);
        let joint_values: Vec<_> = added.iter().flat_map(|(_, of)| dynamics.iter().map(of)).collect();
        unsolved.add(time(row), forces.iter().chain(&joint_values).all(|value| value.is_finite()));
        let commands = Transmission::new(&machine.actuator, &motions.rate_m_s).commands(&forces);
        let known =
            forces.into_iter().chain(motions.length_m).chain(motions.rate_m_s).chain(motions.accel_m_s2);
        let known = known.chain(commands);
        writer.row([time(row)].into_iter().chain(known).chain(joint_values));
    }
    (writer, unsolved.into_result())
}
