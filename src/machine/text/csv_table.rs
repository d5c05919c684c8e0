//! CSV tables of numbers, read with their columns by name.
//!
//! All errors of a file are reported at once (up to a limit), each with line, column, value and bound.

use std::io::Read;
use std::path::Path;

pub use self::errors::TableError;
pub use self::errors::TableErrors;
use self::errors::{cell, is_absent};
pub use super::csv_columns::{
    coordinates, derivative_columns, legs, length_columns, pose_columns, trajectory_columns,
};
pub use super::csv_groups::{GROUPS, in_group};
use super::csv_groups::{select_group, without_group};
use super::csv_rows::CsvRows;
use super::files::{name_of, open};

mod errors;

/// Most rows: 2.8 hours at 1 kHz, and 1.8 GB in memory with the columns of a trajectory.
const MAX_ROWS: usize = 10_000_000;

/// Table of numbers, read from CSV.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NumberTable {
    rows: Vec<Vec<f64>>,
    /// Line of the file that each row begins in.
    lines: Vec<u64>,
}

impl NumberTable {
    /// Reads a CSV file, or standard input for `-`, see [`NumberTable::from_reader`]. `group` names the group of
    /// columns to read, if the file has several.
    pub fn read(
        path: &Path,
        group: Option<&str>,
        required: &[String],
        optional: &[String],
    ) -> Result<Self, TableError> {
        Self::from_group(open(path)?, name_of(path), group, required, optional)
    }

    /// Reads the named columns of CSV text, in this order, whatever the order in the text, and ignores other columns.
    /// Every number must be finite and at most 1e12 in magnitude. Error texts name the source `path`.
    ///
    /// A column may say another unit than SI in its name (`x_mm`, `x [mm]`) or in a row below the header; the rows have SI units.
    /// Fields are separated by commas, semicolons, tabs or bars, as in the header; where not by commas, a number may have a
    /// decimal comma. Blank rows and lines that begin with `#` are left out.
    ///
    /// `optional` columns come after the required ones if the text has all of them.
    ///
    /// In a table of `hexad convert` the columns are of one group, `setpoint_x`. A row that repeats the row before, and rows without a
    /// number in the group before its first and after its last number, are left out.
    pub fn from_reader(
        source: impl Read,
        path: &Path,
        required: &[String],
        optional: &[String],
    ) -> Result<Self, TableError> {
        Self::from_group(source, path, None, required, optional)
    }

    fn from_group(
        source: impl Read,
        path: &Path,
        group: Option<&str>,
        required: &[String],
        optional: &[String],
    ) -> Result<Self, TableError> {
        let mut errors = TableErrors::new(path);
        let mut table = Self::default();
        let result = CsvRows::new(source).map_err(|error| format!("line 1: {error}"));
        let filled =
            result.and_then(|mut rows| table.fill(&mut rows, group, required, optional, &mut errors));
        if let Err(error) = filled {
            errors.add(error);
        }
        if table.rows.is_empty() && errors.is_empty() {
            errors.add("no rows: must have at least one".into());
        }
        errors.into_result().map(|()| table)
    }

    /// Reads header and rows; returns an error after which reading cannot go on.
    fn fill(
        &mut self,
        source: &mut CsvRows<impl Read>,
        group: Option<&str>,
        required: &[String],
        optional: &[String],
        errors: &mut TableErrors,
    ) -> Result<(), String> {
        let names = |record: &csv::ByteRecord| record.iter().map(|name| cell(name).trim().into()).collect();
        let (line, header): (_, Vec<String>) =
            source.next_row()?.map_or((1, vec![]), |(line, record)| (line, names(record)));
        let delimiter = char::from(source.delimiter).to_string();
        let group =
            select_group(&header, required, group).map_err(|error| format!("line {line}: {error}"))?;
        let names = group.map_or_else(|| header.clone(), |group| without_group(&header, group));
        let mut columns = errors.columns(line, &names, &delimiter, required, optional);
        if !errors.is_empty() {
            return Ok(());
        }
        for column in &mut columns {
            column.name = header.get(column.index).cloned().unwrap_or_default();
        }
        let (mut read, is_comma_decimal, mut is_first) = (0, delimiter != ",", true);
        // Line of the first row without numbers after rows with numbers.
        let mut gap = None;
        while let Some((line, record)) = source.next_row()? {
            if read == MAX_ROWS {
                return Err(format!("line {line}: a row after {MAX_ROWS}: must be at most those"));
            }
            if core::mem::take(&mut is_first) && errors.units(record, line, &mut columns) {
                continue;
            }
            read += 1;
            if group.is_some() && columns.iter().all(|column| is_absent(record, column)) {
                gap = gap.or((!self.rows.is_empty()).then_some(line));
                continue;
            }
            if let Some(gap) = gap.take() {
                errors.add(format!(
                    "line {gap}: no {} up to line {line}: must be without a gap; cut the table there",
                    group.unwrap_or_default()
                ));
            }
            let row = errors.row(record, line, header.len(), &columns, is_comma_decimal);
            if let Some(row) = row.filter(|row| group.is_none() || self.rows.last() != Some(row)) {
                self.rows.push(row);
                self.lines.push(line);
            }
        }
        Ok(())
    }

    /// The same with other columns, row by row.
    pub fn with_rows(self, rows: Vec<Vec<f64>>) -> Self {
        Self { rows, ..self }
    }

    /// The rows, each with the requested columns.
    pub fn rows(&self) -> &[Vec<f64>] {
        &self.rows
    }

    /// The rows, to change their numbers.
    pub fn rows_mut(&mut self) -> &mut [Vec<f64>] {
        &mut self.rows
    }

    /// The line of the file that each of the rows begins in.
    pub fn lines(&self) -> &[u64] {
        &self.lines
    }
}

/// Six consecutive columns of a row.
pub fn six(row: &[f64], first: usize) -> [f64; 6] {
    row.get(first..first + 6).and_then(|values| values.try_into().ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests;
