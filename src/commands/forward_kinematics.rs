//! `hexad forward-kinematics`: poses from the leg lengths in a file, and twists if it has rates.

use clap::{Args, ValueEnum};
use indicatif::ProgressIterator;
use nalgebra::Vector6;

use super::arguments::{MachineFile, TableFiles};
use super::failure::Failure;
use super::offline_tables::{UnsolvedRows, time};
use super::orientation::OrientationFormat;
use super::progress::item_bar;
use hexad_core::model::LEGS;
use hexad_core::model::forward_kinematics::{Tracker, TrackingResult};
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::machine::{Actuator, Machine};
use hexad_core::model::rigid::Twist;
use hexad_machine::analysis::assembly_modes::other_permitted_modes;
use hexad_machine::text::csv_table::{NumberTable, legs, length_columns, six};
use hexad_machine::text::csv_writer::CsvWriter;
use hexad_machine::text::files::remark;

/// Share of the stroke by which measured lengths may be beyond it: platforms park at its ends.
const STROKE_TOLERANCE: f64 = 0.01;

#[derive(Debug, Args)]
pub struct ForwardKinematicsArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    files: TableFiles,
    /// Where each row starts
    #[arg(long, value_enum, default_value_t = StartPose::Previous)]
    start: StartPose,
    /// End with code 1 if rows have other poses, too (column other_poses)
    #[arg(long)]
    strict: bool,
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
        let PoseTable { mut output, solved, unique } =
            forward_kinematics(&machine, self.start, self.files.rotation, &table);
        output.save(&self.files.output).map_err(Failure::before_start)?;
        if let Some(text) = stroke_remark(&machine, &table) {
            remark(text);
        }
        match unique {
            Err(text) if !self.strict || solved.is_err() => remark(text),
            unique => unique?,
        }
        Ok(solved?)
    }
}

/// Says which rows have lengths that the legs cannot have, and what else the numbers may be.
fn stroke_remark(machine: &Machine, table: &NumberTable) -> Option<String> {
    let Actuator { min_length_m: min, max_length_m: max, .. } = machine.actuator;
    let tolerance = STROKE_TOLERANCE * (max - min);
    let is_inside = |length: &f64| (min - tolerance..=max + tolerance).contains(length);
    let rows = || table.rows().iter().map(|row| (time(row), six(row, 1)));
    let outside = || {
        rows().filter_map(|(t, lengths)| {
            let leg = lengths.iter().position(|length| !is_inside(length))?;
            Some((t, leg + 1, *lengths.get(leg)?))
        })
    };
    let (t, leg, length) = outside().next()?;
    let home = leg_lengths(machine, &machine.home_pose());
    // All rows, as another quantity.
    let fits = |scale: f64, from: &[f64; LEGS]| {
        rows().all(|(_, numbers)| numbers.iter().zip(from).all(|(it, from)| is_inside(&(from + scale * it))))
    };
    let hint = if fits(1e-3, &[0.0; LEGS]) {
        "; in millimetres all rows fit: name the columns length_1_mm to length_6_mm".into()
    } else if fits(1.0, &home) {
        format!("; as changes from home all rows fit: add the lengths at home, {home:.6?}")
    } else {
        String::new()
    };
    Some(format!(
        "{} of {} rows have lengths outside of the stroke, the first at t = {t:?}: length_{leg} = {length} m, must be {min} to \
         {max} m, between the joint centres{hint}",
        outside().count(),
        table.rows().len(),
    ))
}

/// Poses for a table of lengths, twists if it has rates.
pub struct PoseTable {
    pub output: CsvWriter,
    /// Whether all rows have a pose.
    pub solved: Result<(), UnsolvedRows>,
    /// Whether none has another one, too: [`other_permitted_modes`] of the first row, and of each that starts at home.
    pub unique: Result<(), UnsolvedRows>,
}

/// The poses of a table of lengths.
pub fn forward_kinematics(
    machine: &Machine,
    start: StartPose,
    format: OrientationFormat,
    table: &NumberTable,
) -> PoseTable {
    let has_rates = table.rows().first().is_some_and(|row| row.len() > 1 + LEGS);
    let mut columns = format.pose_columns();
    columns.extend(["iterations", "converged", "other_poses"].map(String::from));
    if has_rates {
        columns.extend(["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"].map(String::from));
    }
    let mut output = CsvWriter::new(&columns);
    let mut unsolved = UnsolvedRows::new("did not converge (column converged)");
    let mut ambiguous = UnsolvedRows::new("have the lengths of other poses, too (column other_poses)");
    // Of the row from which the present one was followed.
    let mut others = None;
    let home = Tracker::new(machine, machine.home_pose());
    let (mut tracker, mut near) = (home, format.before_first(&machine.home));
    for row in table.rows().iter().progress_with(item_bar(table.rows().len(), "rows")) {
        if start == StartPose::Home {
            (tracker, near, others) = (home, format.before_first(&machine.home), None);
        }
        // After a row without a solution the start of the next row does not change.
        let mut walker = tracker;
        let (tracked, iterations) = walker.find(machine, &six(row, 1));
        let converged = tracked == TrackingResult::Found;
        let others = if converged {
            *others
                .get_or_insert_with(|| other_permitted_modes(machine, walker.kinematic_state()).poses.len())
        } else {
            0
        };
        let numbers = format.numbers(walker.pose(), &near);
        if converged {
            (tracker, near) = (walker, numbers.clone());
        }
        let twist = has_rates
            .then(|| walker.kinematic_state().twist(machine, &six(row, 1 + LEGS)))
            .map(|twist| twist.as_ref().map_or(Vector6::repeat(f64::NAN), Twist::vector));
        unsolved.add(time(row), converged);
        ambiguous.add(time(row), others == 0);
        let found = [f64::from(iterations), f64::from(u8::from(converged)), others as f64];
        output
            .row([time(row)].into_iter().chain(numbers).chain(found).chain(twist.iter().flatten().copied()));
    }
    PoseTable { output, solved: unsolved.into_result(), unique: ambiguous.into_result() }
}
