//! Rows of the CSV files that the offline commands share.

use std::path::Path;

use super::failure::CommandError;
use crate::model::task::TaskState;
use crate::output::csv_table::{NumberTable, TableError, six, trajectory_columns};

/// Error for rows without a solution. The output is complete and marks them; the error makes sure that nobody misses
/// them.
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
    /// Count of zero; `problem` says what an unsolved row lacks.
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

    /// Itself as an error, if any row is unsolved.
    pub fn into_result(self) -> Result<(), Self> {
        if self.count == 0 { Ok(()) } else { Err(self) }
    }
}

/// Reads a table of t, X, X', X''.
pub fn read_trajectory(path: &Path) -> Result<NumberTable, TableError> {
    NumberTable::read(path, &trajectory_columns(), &[])
}

/// Time of a row.
pub fn time(row: &[f64]) -> f64 {
    row.first().copied().unwrap_or_default()
}

/// X, X', X'' of a row of a trajectory.
pub fn task_state(row: &[f64]) -> TaskState {
    TaskState { x: six(row, 1).into(), xd: six(row, 7).into(), xdd: six(row, 13).into() }
}
