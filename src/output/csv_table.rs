//! CSV tables of numbers, read with their columns by name.
//!
//! All errors of a file are reported at once (up to a limit), each with line, column, value and bound.

use std::borrow::Cow;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::csv_columns::{Column, find, hint};
pub use super::csv_columns::{
    coordinates, derivative_columns, legs, length_columns, pose_columns, trajectory_columns,
};
use super::csv_rows::CsvRows;
use super::excerpt::excerpt;
use super::files::{FileError, name_of, open};
use super::numbers::MAX_MAGNITUDE;

/// Errors shown of one file; a file with more has one mistake many times.
const MAX_ERRORS_SHOWN: usize = 20;

/// Most rows: 2.8 hours at 1 kHz, and 1.8 GB in memory with the columns of a trajectory.
const MAX_ROWS: usize = 10_000_000;

/// Error of reading a table: the file, or its content.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The content is not the expected table: one message for each error.
    #[error("{}", .0.join("\n"))]
    Content(Vec<String>),
}

/// Table of numbers, read from CSV.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NumberTable {
    rows: Vec<Vec<f64>>,
    /// Line of the file that each row begins in.
    lines: Vec<u64>,
}

impl NumberTable {
    /// Reads a CSV file, or standard input for `-`, see [`NumberTable::from_reader`].
    pub fn read(path: &Path, required: &[String], optional: &[String]) -> Result<Self, TableError> {
        Self::from_reader(open(path)?, name_of(path), required, optional)
    }

    /// Reads the named columns of CSV text, in this order, whatever the order in the text, and ignores other columns.
    /// Every number must be finite and at most 1e12 in magnitude. Error texts name the source `path`.
    ///
    /// A column may say another unit than SI in its name (`x_mm`, `t_ms`); the rows have SI units. Fields are separated by commas,
    /// semicolons or tabs, as in the header; where not by commas, a number may have a decimal comma.
    ///
    /// `optional` columns come after the required ones if the text has all of them.
    pub fn from_reader(
        source: impl Read,
        path: &Path,
        required: &[String],
        optional: &[String],
    ) -> Result<Self, TableError> {
        let mut errors = TableErrors::new(path);
        let mut table = Self::default();
        let result = CsvRows::new(source).map_err(|error| format!("line 1: {error}"));
        if let Err(error) = result.and_then(|mut rows| table.fill(&mut rows, required, optional, &mut errors))
        {
            errors.add(error);
        }
        if table.rows.is_empty() && errors.list.is_empty() {
            errors.add("no rows: must have at least one".into());
        }
        errors.into_result().map(|()| table)
    }

    /// Reads header and rows; returns an error after which reading cannot go on.
    fn fill(
        &mut self,
        source: &mut CsvRows<impl Read>,
        required: &[String],
        optional: &[String],
        errors: &mut TableErrors,
    ) -> Result<(), String> {
        let names = |record: &csv::ByteRecord| record.iter().map(|name| cell(name).trim().into()).collect();
        let (line, header): (_, Vec<String>) =
            source.next_row()?.map_or((1, vec![]), |(line, record)| (line, names(record)));
        let columns = errors.columns(line, &header, required, optional);
        if !errors.list.is_empty() {
            return Ok(());
        }
        let (mut read, is_comma_decimal) = (0, source.delimiter() != b',');
        while let Some((line, record)) = source.next_row()? {
            if read == MAX_ROWS {
                return Err(format!("line {line}: a row after {MAX_ROWS}: must be at most those"));
            }
            read += 1;
            if let Some(row) = errors.row(record, line, header.len(), &columns, is_comma_decimal) {
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

/// Text of a field. Bytes that are not UTF-8 become a character that is part of no name and no number.
fn cell(field: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(field)
}

/// A number, with a decimal comma where those do not separate fields.
fn number(text: &str, is_comma_decimal: bool) -> Option<f64> {
    if is_comma_decimal && text.contains(',') && !text.contains('.') {
        return text.replacen(',', ".", 1).parse().ok();
    }
    text.parse().ok()
}

/// Errors found in the content of one file.
pub(crate) struct TableErrors {
    path: PathBuf,
    list: Vec<String>,
    /// Errors beyond those in the list.
    more: usize,
}

impl TableErrors {
    pub fn new(path: &Path) -> Self {
        Self { path: path.into(), list: vec![], more: 0 }
    }

    /// Adds an error: place, value and bound, without the file.
    pub fn add(&mut self, error: String) {
        if self.list.len() < MAX_ERRORS_SHOWN {
            self.list.push(format!("{}: {error}", self.path.display()));
        } else {
            self.more += 1;
        }
    }

    /// All errors as one, if there are any.
    pub fn into_result(mut self) -> Result<(), TableError> {
        if self.more > 0 {
            self.list.push(format!("{}: and {} more", self.path.display(), self.more));
        }
        if self.list.is_empty() { Ok(()) } else { Err(TableError::Content(self.list)) }
    }

    /// Every column to be read.
    fn columns(
        &mut self,
        line: u64,
        header: &[String],
        required: &[String],
        optional: &[String],
    ) -> Vec<Column> {
        let mut found = |names: &[String]| -> Vec<Column> {
            let mut columns = vec![];
            for name in names {
                let mut places = find(header, name);
                if places.len() > 1 {
                    self.add(format!(
                        "line {line}: column {name} appears {} times: must appear once",
                        places.len()
                    ));
                }
                columns.extend(places.drain(..).next());
            }
            columns
        };
        let (mut columns, optional_found) = (found(required), found(optional));
        let missing = |names: &[String]| -> Vec<String> {
            let absent = names.iter().filter(|name| find(header, name).is_empty());
            absent.map(|name| format!("{name}{}", hint(header, name))).collect()
        };
        let absent = missing(required);
        if !absent.is_empty() {
            self.add(format!("line {line}: missing columns {}", absent.join(", ")));
        }
        if !optional_found.is_empty() && optional_found.len() < optional.len() {
            let absent = missing(optional).join(", ");
            self.add(format!(
                "line {line}: missing columns {absent}: of {} either all or none must be there",
                optional.join(", ")
            ));
        }
        columns.extend(optional_found);
        columns
    }

    fn row(
        &mut self,
        record: &csv::ByteRecord,
        line: u64,
        width: usize,
        columns: &[Column],
        is_comma_decimal: bool,
    ) -> Option<Vec<f64>> {
        if record.len() != width {
            let cure = "; with decimal commas the fields must be separated by semicolons";
            let cure = if record.len() > width && !is_comma_decimal { cure } else { "" };
            self.add(format!(
                "line {line}: {} fields: must be {width}, as in the header{cure}",
                record.len()
            ));
            return None;
        }
        let mut row = Vec::with_capacity(columns.len());
        for Column { index, name, factor } in columns {
            let text = cell(record.get(*index).unwrap_or_default());
            match number(text.trim(), is_comma_decimal).map(|value| value * factor) {
                Some(value) if value.abs() <= MAX_MAGNITUDE => row.push(value),
                Some(value) => {
                    let finite = value.is_finite().then(|| format!("at most {MAX_MAGNITUDE:e} in magnitude"));
                    let bound = finite.unwrap_or("finite".into());
                    self.add(format!("line {line}: {name} = {}: must be {bound}", excerpt(&text)));
                }
                None => self.add(format!("line {line}: {name} = \"{}\": must be a number", excerpt(&text))),
            }
        }
        (row.len() == columns.len()).then_some(row)
    }
}

/// Six consecutive columns of a row.
pub fn six(row: &[f64], first: usize) -> [f64; 6] {
    row.get(first..first + 6).and_then(|values| values.try_into().ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests;
