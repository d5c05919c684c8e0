//! Rows of the CSV files that the offline commands share.

use std::path::Path;

use super::failure::CommandError;
use crate::analysis::pose_spline;
use crate::model::task::TaskState;
use crate::motion::trajectory::Knot;
use crate::output::csv_table::{
    NumberTable, TableError, TableErrors, derivative_columns, pose_columns, six, trajectory_columns,
};
use crate::output::files::name_of;

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
    fn has_begun(&self) -> bool {
        true
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

/// Reads a table of t, X, X', X''. If X' and X'' are missing, they are computed from the spline through the
/// poses.
pub fn read_trajectory(path: &Path) -> Result<NumberTable, TableError> {
    let table = NumberTable::read(path, &pose_columns(), &derivative_columns())?;
    with_derivatives(table, name_of(path))
}

/// Adds X' and X'' to a table that has only poses.
pub fn with_derivatives(table: NumberTable, path: &Path) -> Result<NumberTable, TableError> {
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
        .map(|row| Knot { t: time(row), state: TaskState::at_rest(six(row, 1)) })
        .collect();
    if pose_spline::complete(&mut knots).is_none() {
        let mut errors = TableErrors::new(path);
        errors.add("X' and X'' cannot be computed: the steps of t must be less unequal".into());
        errors.into_result()?;
    }
    let numbers = |Knot { t, state: TaskState { x, xd, xdd } }: &Knot| {
        [*t].into_iter().chain([x, xd, xdd].into_iter().flatten().copied()).collect()
    };
    let rows = knots.iter().map(numbers).collect();
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
