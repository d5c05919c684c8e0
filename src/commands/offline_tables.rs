//! Rows of the CSV files that the offline commands share.

use std::path::Path;

use super::failure::CommandError;
use super::orientation::OrientationFormat;
use hexad_core::model::task::TaskState;
use hexad_core::motion::trajectory::Knot;
use hexad_machine::analysis::pose_spline;
use hexad_machine::text::csv_table::{
    NumberTable, TableError, TableErrors, derivative_columns, pose_columns, six, trajectory_columns,
};
use hexad_machine::text::files::name_of;

/// Error for rows without a solution. The output is complete and marks them; the error makes the failure
/// visible.
#[derive(Debug, Default, thiserror::Error)]
#[error("{count} of {rows} rows {problem}, the first at t = {first:?}")]
pub struct UnsolvedRows {
    count: usize,
    rows: usize,
    problem: &'static str,
    first: f64,
}

impl CommandError for UnsolvedRows {
    fn exit_code(&self) -> u8 {
        1
    }
}

impl CommandError for TableError {}

impl UnsolvedRows {
    /// Counter at zero. `problem` says what is missing in an unsolved row.
    pub fn new(problem: &'static str) -> Self {
        Self { problem, ..Self::default() }
    }

    /// Counts the row of time `t`.
    pub fn add(&mut self, t: f64, is_solved: bool) {
        self.rows += 1;
        if !is_solved {
            self.first = if self.count == 0 { t } else { self.first };
            self.count += 1;
        }
    }

    /// The count as an error, if any row is unsolved.
    pub fn into_result(self) -> Result<(), Self> {
        if self.count == 0 { Ok(()) } else { Err(self) }
    }
}

/// Least time between two rows of a trajectory \[s\], far below the period of any loop. Between closer rows,
/// X'' has no significant digits.
const MIN_STEP_S: f64 = 1e-6;

/// Reads a table of t, X, X', X'', with orientations in a format. If X' and X'' are missing, they are computed from the spline
/// through the poses. Each row has the triple of Bryan angles nearest to the row before, the first row nearest to `home`.
pub fn read_trajectory(
    path: &Path,
    group: Option<&str>,
    format: OrientationFormat,
    home: &[f64; 6],
) -> Result<NumberTable, TableError> {
    let table = NumberTable::read(path, group, &format.pose_columns(), &derivative_columns())?;
    let path = name_of(path);
    let mut table = in_task_coordinates(table, format, path, home)?;
    continue_angles(&mut table, home);
    with_derivatives(table, path)
}

/// Reads a table of targets: poses, each with the number of its row in the place of `t`. Angles stay as they are.
pub fn read_targets(
    path: &Path,
    format: OrientationFormat,
    home: &[f64; 6],
) -> Result<NumberTable, TableError> {
    let columns: Vec<_> = format.pose_columns().into_iter().skip(1).collect();
    let table = NumberTable::read(path, None, &columns, &[])?;
    let numbered = |(row, number): (&Vec<f64>, u32)| [&[f64::from(number)], &row[..]].concat();
    let rows = table.rows().iter().zip(1..).map(numbered).collect();
    in_task_coordinates(table.with_rows(rows), format, name_of(path), home)
}

/// The rows of a table with orientations in a format as rows of X.
fn in_task_coordinates(
    table: NumberTable,
    format: OrientationFormat,
    path: &Path,
    home: &[f64; 6],
) -> Result<NumberTable, TableError> {
    if format == OrientationFormat::OF_X {
        return Ok(table);
    }
    let mut errors = TableErrors::new(path);
    let (mut near, mut rows) = (*home, vec![]);
    let [found, needed] = [format.pose_columns(), pose_columns()].map(|columns| columns.len());
    for (row, line) in table.rows().iter().zip(table.lines()) {
        let has_derivatives = row.len() > found;
        match format.state(row, has_derivatives, &near) {
            Ok(state) => {
                near = state.x.into();
                let width = if has_derivatives { usize::MAX } else { needed };
                rows.push(numbers(Knot { t_s: time(row), state }).take(width).collect());
            }
            Err(error) => errors.add(format!("line {line}: {error}")),
        }
    }
    errors.into_result().map(|()| table.with_rows(rows))
}

/// Chooses the triples of angles that continue each other: an angle that passes 180 deg does not jump.
fn continue_angles(table: &mut NumberTable, home: &[f64; 6]) {
    let mut near = *home;
    for row in table.rows_mut() {
        let state = task_state(row).nearest_to(&near);
        near = state.x.into();
        let nearest = numbers(Knot { t_s: time(row), state });
        row.iter_mut().zip(nearest).for_each(|(number, nearest)| *number = nearest);
    }
}

/// The numbers of a row of a trajectory.
fn numbers(Knot { t_s, state: TaskState { x, xd, xdd } }: Knot) -> impl Iterator<Item = f64> {
    [t_s].into_iter().chain([x, xd, xdd].into_iter().flat_map(<[f64; 6]>::from))
}

/// Adds X' and X'' to a table that has only poses.
fn with_derivatives(table: NumberTable, path: &Path) -> Result<NumberTable, TableError> {
    let width = trajectory_columns().len();
    if table.rows().iter().all(|row| row.len() == width) {
        return Ok(table);
    }
    let mut errors = TableErrors::new(path);
    check_times(&table, &mut errors);
    errors.into_result()?;
    let mut knots: Vec<_> = table
        .rows()
        .iter()
        .map(|row| Knot { t_s: time(row), state: TaskState::at_rest(six(row, 1)) })
        .collect();
    if pose_spline::complete(&mut knots).is_none() {
        let mut errors = TableErrors::new(path);
        errors.add("X' and X'' cannot be computed: the steps of t must be less unequal".into());
        errors.into_result()?;
    }
    let rows = knots.into_iter().map(|knot| numbers(knot).collect()).collect();
    Ok(table.with_rows(rows))
}

/// Adds an error for each row whose time is not later than the previous one.
pub fn check_times(table: &NumberTable, errors: &mut TableErrors) {
    let rows = || table.rows().iter().map(|row| time(row)).zip(table.lines());
    for ((before, _), (after, line)) in rows().zip(rows().skip(1)) {
        if !(after - before >= MIN_STEP_S) {
            errors.add(format!(
                "line {line}: t = {after:?} after t = {before:?}: must increase, by at least {MIN_STEP_S:?}"
            ));
        }
    }
}

/// Time of a row.
pub fn time(row: &[f64]) -> f64 {
    row.first().copied().unwrap_or_default()
}

/// X, X', X'' of a row of a trajectory.
pub fn task_state(row: &[f64]) -> TaskState {
    TaskState { x: six(row, 1).into(), xd: six(row, 7).into(), xdd: six(row, 13).into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, PI};
    use hexad_core::motion::minimum_jerk::rise;

    /// Table of a motion that begins at the angles `start`, each row with its own triple of angles.
    fn read(start: [f64; 3], triple: fn([f64; 3]) -> [f64; 3]) -> NumberTable {
        let mut text = pose_columns().join(",") + "\n";
        for t in (0..=40).map(|k| 0.05 * f64::from(k)) {
            let [alpha, beta, gamma] = triple(start.map(|angle| angle + 0.2 * rise(t, 2.0).value_share));
            text += &format!("{t},{alpha:?},{beta:?},{gamma:?},0,0,0.65\n");
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(&file, text).unwrap();
        let home = [start[0], start[1], start[2], 0.0, 0.0, 0.65];
        read_trajectory(file.path(), None, OrientationFormat::OF_X, &home).unwrap()
    }

    /// As in a live stream, where poses are compared: another triple of the same orientation changes no motion.
    #[test]
    fn angles_that_pass_180_deg_continue() {
        let wrapped = |angles: [f64; 3]| angles.map(|angle| angle - (angle / (2.0 * PI)).round() * 2.0 * PI);
        let upright = |[alpha, beta, gamma]: [f64; 3]| {
            if beta > FRAC_PI_2 { [alpha + PI, PI - beta, gamma + PI] } else { [alpha, beta, gamma] }
        };
        for start in [[0.0, 0.1, PI - 0.1], [PI, -0.1, -PI], [0.3, FRAC_PI_2 - 0.13, 0.2]] {
            let continued = read(start, |angles| angles);
            for table in [read(start, wrapped), read(start, upright)] {
                for (a, b) in table.rows().iter().flatten().zip(continued.rows().iter().flatten()) {
                    assert!((a - b).abs() < 1e-9, "{start:?}: {a}, not {b}");
                }
            }
        }
    }
}
