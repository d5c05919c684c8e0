//! `hexad inverse-dynamics`: actuator forces and leg motions of the rows of a file.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::arguments::{MachineFile, TableFiles};
use super::failure::Failure;
use super::offline_tables::{UnsolvedRows, read_trajectory, task_state, time};
use super::progress::item_bar;
use crate::analysis::batch;
use crate::model::LEGS;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::inverse_geometry::leg_motion;
use crate::model::machine::Machine;
use crate::output::csv_table::{NumberTable, legs};
use crate::output::csv_writer::CsvWriter;

#[derive(Debug, Args)]
pub struct InverseDynamicsArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    files: TableFiles,
    /// Fidelity of the dynamic model
    #[arg(long = "model", value_name = "MODEL", default_value = Fidelity::Exact.name(), value_parser = fidelity_by_name())]
    fidelity: Fidelity,
}

impl InverseDynamicsArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let machine = self.machine.load()?.machine;
        let TableFiles { input, rotation, group, .. } = &self.files;
        let table = read_trajectory(input, group.as_deref(), *rotation, &machine.home)?;
        let (mut output, result) = inverse_dynamics(&machine, self.fidelity, &table);
        output.save(&self.files.output).map_err(Failure::before_start)?;
        Ok(result?)
    }
}

fn fidelity_by_name() -> impl TypedValueParser<Value = Fidelity> {
    PossibleValuesParser::new(Fidelity::ALL.map(Fidelity::name)).map(|name| {
        Fidelity::ALL.into_iter().find(|fidelity| fidelity.name() == name).unwrap_or(Fidelity::Exact)
    })
}

/// Forces, lengths and their derivatives for a table with the columns of a trajectory, and whether all rows
/// have forces. At a singular pose the forces are NaN.
pub fn inverse_dynamics(
    machine: &Machine,
    fidelity: Fidelity,
    table: &NumberTable,
) -> (CsvWriter, Result<(), UnsolvedRows>) {
    let mut columns = vec!["t".into()];
    for stem in ["force", "length", "length_rate", "length_accel"] {
        columns.extend(legs(stem));
    }
    let motions: Vec<_> = table.rows().iter().map(|row| task_state(row).motion()).collect();
    let mut forces = vec![None; motions.len()];
    let bar = item_bar(motions.len(), "rows");
    batch::forces(&InverseDynamics::new(machine), fidelity, &motions, &mut forces, 0, &bar);
    bar.finish_and_clear();
    let mut writer = CsvWriter::new(&columns);
    let mut unsolved = UnsolvedRows::new("are at singular poses and have no forces");
    for (row, (motion, forces)) in table.rows().iter().zip(motions.iter().zip(forces)) {
        unsolved.add(time(row), forces.is_some());
        let (forces, legs) = (forces.unwrap_or([f64::NAN; LEGS]), leg_motion(machine, motion));
        writer
            .row([time(row)].into_iter().chain(forces).chain(legs.length).chain(legs.rate).chain(legs.accel));
    }
    (writer, unsolved.into_result())
}
