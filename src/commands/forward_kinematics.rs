//! `hexad forward-kinematics`: poses from the leg lengths in a file, and twists if it has rates.

use clap::{Args, ValueEnum};
use indicatif::ProgressIterator;
use nalgebra::Vector6;

use super::arguments::{MachineFile, TableFiles};
use super::failure::Failure;
use super::offline_tables::{UnsolvedRows, time};
use super::orientation::OrientationFormat;
use super::progress::item_bar;
use crate::model::LEGS;
use crate::model::forward_kinematics::{Tracker, TrackingResult};
use crate::model::machine::Machine;
use crate::model::rigid::Twist;
use crate::output::csv_table::{NumberTable, legs, length_columns, six};
use crate::output::csv_writer::CsvWriter;

#[derive(Debug, Args)]
pub struct ForwardKinematicsArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    files: TableFiles,
    /// Where each row starts
    #[arg(long, value_enum, default_value_t = StartPose::Previous)]
    start: StartPose,
}

/// Pose from which the search for the pose of a row starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum StartPose {
    /// At the row before, the first at home
    Previous,
    /// At home
    Home,
}

impl ForwardKinematicsArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let machine = self.machine.load()?.machine;
        let TableFiles { input, group, .. } = &self.files;
        let table = NumberTable::read(input, group.as_deref(), &length_columns(), &legs("length_rate"))?;
        let (mut output, result) = forward_kinematics(&machine, self.start, self.files.rotation, &table);
        output.save(&self.files.output).map_err(Failure::before_start)?;
        Ok(result?)
    }
}

/// Poses for a table of lengths, twists if it has rates, and whether all rows have a pose.
pub fn forward_kinematics(
    machine: &Machine,
    start: StartPose,
    format: OrientationFormat,
    table: &NumberTable,
) -> (CsvWriter, Result<(), UnsolvedRows>) {
    let has_rates = table.rows().first().is_some_and(|row| row.len() > 1 + LEGS);
    let mut columns = format.pose_columns();
    columns.extend(["iterations", "converged"].map(String::from));
    if has_rates {
        columns.extend(["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"].map(String::from));
    }
    let mut writer = CsvWriter::new(&columns);
    let mut unsolved = UnsolvedRows::new("did not converge (column converged)");
    let home = Tracker::new(machine, machine.home_pose());
    let (mut tracker, mut near) = (home, format.before_first(&machine.home));
    for row in table.rows().iter().progress_with(item_bar(table.rows().len(), "rows")) {
        if start == StartPose::Home {
            (tracker, near) = (home, format.before_first(&machine.home));
        }
        // After a row without a solution the start of the next row does not change.
        let mut walker = tracker;
        let (tracked, iterations) = walker.find(machine, &six(row, 1));
        let converged = tracked == TrackingResult::Found;
        let numbers = format.numbers(walker.pose(), &near);
        if converged {
            (tracker, near) = (walker, numbers.clone());
        }
        let twist = has_rates
            .then(|| walker.kinematic_state().twist(machine, &six(row, 1 + LEGS)))
            .map(|twist| twist.as_ref().map_or(Vector6::repeat(f64::NAN), Twist::vector));
        unsolved.add(time(row), converged);
        let found = [f64::from(iterations), f64::from(u8::from(converged))];
        writer
            .row([time(row)].into_iter().chain(numbers).chain(found).chain(twist.iter().flatten().copied()));
    }
    (writer, unsolved.into_result())
}
