//! Rows of the CSV files that the offline commands share.

use std::path::Path;

use crate::model::task::TaskState;
use crate::output::csv_table::{NumberTable, TableError, six, trajectory_columns};
use crate::output::files::FileError;

use super::failure::CommandError;

/// Error of an offline command.
#[derive(Debug, thiserror::Error)]
pub enum OfflineError {
    #[error(transparent)]
    Input(#[from] TableError),
    #[error(transparent)]
    Output(#[from] FileError),
    /// The output is complete and marks the rows; the error makes sure that nobody misses them.
    #[error("{count} of {rows} rows {problem}, the first at t = {first:?}")]
    Unsolved { count: usize, rows: usize, problem: &'static str, first: f64 },
}

impl CommandError for OfflineError {
    fn has_begun(&self) -> bool {
        matches!(self, Self::Unsolved { .. })
    }
}

/// Count of the rows without a solution.
#[derive(Default)]
pub struct UnsolvedRows {
    count: usize,
    first: f64,
}

impl UnsolvedRows {
    /// Counts the row of time `t` unless it is solved.
    pub fn add(&mut self, t: f64, is_solved: bool) {
        if !is_solved {
            if self.count == 0 {
                self.first = t;
            }
            self.count += 1;
        }
    }

    /// Error if any of `rows` is unsolved; `problem` says what an unsolved row lacks.
    pub fn into_result(self, rows: usize, problem: &'static str) -> Result<(), OfflineError> {
        let Self { count, first } = self;
        if count == 0 { Ok(()) } else { Err(OfflineError::Unsolved { count, rows, problem, first }) }
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
