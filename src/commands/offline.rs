//! `hexad inverse-dynamics` and `hexad forward-kinematics`: the model on files, away from the loop.

use std::path::Path;

use indicatif::{ProgressBar, ProgressIterator, ProgressStyle};
use nalgebra::Vector6;

use crate::analysis::batch;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::forward_kinematics::{Tracker, TrackingResult};
use crate::model::inverse_geometry::leg_motion;
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::Twist;
use crate::model::task::{TaskState, task_coordinates};
use crate::output::csv_table::{
    Table, TableError, Writer, coordinates, legs, length_columns, six, trajectory_columns,
};
use crate::output::files::FileError;

/// Why an offline command failed.
#[derive(Debug, thiserror::Error)]
pub enum OfflineError {
    #[error(transparent)]
    Input(#[from] TableError),
    #[error(transparent)]
    Output(#[from] FileError),
    /// The output is complete and marks the rows; nobody should miss it.
    #[error("{count} of {rows} rows {what}, the first at t = {first:?}")]
    Unsolved { count: usize, rows: usize, what: &'static str, first: f64 },
}

/// Where each row of forward kinematics starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// At the row before; the first at home.
    Previous,
    /// At home.
    Home,
}

/// X, X', X'' to forces, lengths and their derivatives. At a singular pose the forces are NaN.
pub fn inverse_dynamics_file(
    machine: &Machine,
    fidelity: Fidelity,
    input: &Path,
    output: &Path,
) -> Result<(), OfflineError> {
    let (result, verdict) =
        inverse_dynamics(machine, fidelity, &Table::read(input, &trajectory_columns(), &[])?);
    result.save(output)?;
    verdict
}

/// The output for a table with the columns of a trajectory, and whether all rows have forces.
pub fn inverse_dynamics(
    machine: &Machine,
    fidelity: Fidelity,
    table: &Table,
) -> (Writer, Result<(), OfflineError>) {
    let mut columns = vec!["t".into()];
    for stem in ["force", "length", "length_rate", "length_accel"] {
        columns.extend(legs(stem));
    }
    let motions: Vec<_> = table.rows().iter().map(|row| task_state(row).motion()).collect();
    let mut forces = vec![None; motions.len()];
    let bar = progress(motions.len(), "rows");
    batch::forces(&InverseDynamics::new(machine), fidelity, &motions, &mut forces, &bar);
    bar.finish_and_clear();
    let mut writer = Writer::new(&columns);
    let mut unsolved = Unsolved::default();
    for (row, (motion, forces)) in table.rows().iter().zip(motions.iter().zip(forces)) {
        let t = row.first().copied().unwrap_or_default();
        unsolved.count(t, forces.is_some());
        let forces = forces.unwrap_or([f64::NAN; LEGS]);
        let legs = leg_motion(machine, motion);
        writer.row([t].into_iter().chain(forces).chain(legs.length).chain(legs.rate).chain(legs.accel));
    }
    (writer, unsolved.verdict(table.rows().len(), "are at singular poses and have no forces"))
}

/// Lengths, and rates if the file has them, to poses and twists. `--start` says where a row begins.
pub fn forward_kinematics_file(
    machine: &Machine,
    start: Start,
    input: &Path,
    output: &Path,
) -> Result<(), OfflineError> {
    let table = Table::read(input, &length_columns(), &legs("length_rate"))?;
    let (result, verdict) = forward_kinematics(machine, start, &table);
    result.save(output)?;
    verdict
}

/// The output for a table with the columns of lengths, perhaps of rates, and whether all rows have a pose.
pub fn forward_kinematics(
    machine: &Machine,
    start: Start,
    table: &Table,
) -> (Writer, Result<(), OfflineError>) {
    let with_rates = table.rows().first().is_some_and(|row| row.len() > 1 + LEGS);
    let mut columns = vec!["t".into()];
    columns.extend(coordinates(""));
    columns.extend(["iterations", "converged"].map(String::from));
    if with_rates {
        columns.extend(["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"].map(String::from));
    }
    let mut writer = Writer::new(&columns);
    let mut unsolved = Unsolved::default();
    let home = Tracker::new(machine, TaskState::at_rest(machine.home).motion().pose);
    let (mut tracker, mut near) = (home, machine.home);
    for row in table.rows().iter().progress_with(progress(table.rows().len(), "rows")) {
        if start == Start::Home {
            (tracker, near) = (home, machine.home);
        }
        let t = row.first().copied().unwrap_or_default();
        // A row without solution leaves the start of the next one where it was.
        let mut walker = tracker;
        let (tracked, iterations) = walker.find(machine, &six(row, 1));
        let converged = tracked == TrackingResult::Found;
        let x = task_coordinates(&walker.pose, &near);
        if converged {
            (tracker, near) = (walker, x);
        }
        let twist = with_rates
            .then(|| walker.kinematic_state().twist(machine, &six(row, 1 + LEGS)))
            .map(|twist| twist.as_ref().map_or(Vector6::repeat(f64::NAN), Twist::vector));
        unsolved.count(t, converged);
        let found = [f64::from(iterations), f64::from(u8::from(converged))];
        writer.row([t].into_iter().chain(x).chain(found).chain(twist.iter().flatten().copied()));
    }
    (writer, unsolved.verdict(table.rows().len(), "did not converge (column converged)"))
}

/// X, X', X'' of a row with the columns of [`trajectory_columns`].
pub(super) fn task_state(row: &[f64]) -> TaskState {
    TaskState { x: six(row, 1).into(), xd: six(row, 7).into(), xdd: six(row, 13).into() }
}

/// A bar on a terminal, nothing elsewhere.
pub(super) fn progress(count: usize, what: &str) -> ProgressBar {
    let template = format!("{{bar:40}} {{human_pos}} of {{human_len}} {what}, {{eta}} left");
    let style = ProgressStyle::with_template(&template);
    ProgressBar::new(count as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Counts the rows without solution.
#[derive(Default)]
struct Unsolved {
    count: usize,
    first: f64,
}

impl Unsolved {
    fn count(&mut self, t: f64, solved: bool) {
        if !solved {
            if self.count == 0 {
                self.first = t;
            }
            self.count += 1;
        }
    }

    fn verdict(self, rows: usize, what: &'static str) -> Result<(), OfflineError> {
        let Self { count, first } = self;
        if count == 0 { Ok(()) } else { Err(OfflineError::Unsolved { count, rows, what, first }) }
    }
}
