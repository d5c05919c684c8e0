//! CSV tables of numbers, read with their columns by name.
//!
//! All errors of a file are reported at once (up to a limit), each with line, column, value and bound.

use std::borrow::Cow;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::csv_columns::{Column, factor, find, hint, nearest_header, unit_names};
pub use super::csv_columns::{
    coordinates, derivative_columns, legs, length_columns, pose_columns, trajectory_columns,
};
use super::csv_rows::CsvRows;
use super::excerpt::{excerpt, excerpt_of_length};
use super::files::{FileError, name_of, open};
use super::numbers::MAX_MAGNITUDE;

/// Errors shown of one file; a file with more has one mistake many times.
const MAX_ERRORS_SHOWN: usize = 20;

/// Characters shown of a header; that of a trajectory has 134 without units.
const MAX_HEADER_SHOWN: usize = 240;

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
    /// A column may say another unit than SI in its name (`x_mm`, `x [mm]`) or in a row below the header; the rows have SI units.
    /// Fields are separated by commas, semicolons, tabs or bars, as in the header; where not by commas, a number may have a
    /// decimal comma. Blank rows and lines that begin with `#` are left out.
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
        let delimiter = char::from(source.delimiter()).to_string();
        let mut columns = errors.columns(line, &header, &delimiter, required, optional);
        if !errors.list.is_empty() {
            return Ok(());
        }
        let (mut read, is_comma_decimal, mut is_first) = (0, delimiter != ",", true);
        while let Some((line, record)) = source.next_row()? {
            if read == MAX_ROWS {
                return Err(format!("line {line}: a row after {MAX_ROWS}: must be at most those"));
            }
            if core::mem::take(&mut is_first) && errors.units(record, line, &mut columns) {
                continue;
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

/// Mistake that many rows, or many cells of a column, may have.
#[derive(Clone, Copy, PartialEq)]
enum Mistake {
    FieldCount(usize),
    NotANumber { column: usize },
    NotFinite { column: usize },
    Magnitude { column: usize },
}

/// An error, or the first of those with the same mistake.
struct FirstError {
    text: String,
    mistake: Option<Mistake>,
    count: usize,
}

/// Errors found in the content of one file.
pub(crate) struct TableErrors {
    path: PathBuf,
    list: Vec<FirstError>,
    /// Errors beyond those in the list.
    more: usize,
}

impl TableErrors {
    pub fn new(path: &Path) -> Self {
        Self { path: path.into(), list: vec![], more: 0 }
    }

    /// Adds an error: place, value and bound, without the file.
    pub fn add(&mut self, error: String) {
        self.add_first(None, || error);
    }

    /// Counts an error, and adds it if it is the first with this mistake.
    fn add_first(&mut self, mistake: Option<Mistake>, error: impl FnOnce() -> String) {
        if let Some(first) = self.list.iter_mut().find(|first| mistake.is_some() && first.mistake == mistake)
        {
            first.count += 1;
        } else if self.list.len() < MAX_ERRORS_SHOWN {
            self.list.push(FirstError { text: error(), mistake, count: 1 });
        } else {
            self.more += 1;
        }
    }

    /// All errors as one, if there are any.
    pub fn into_result(self) -> Result<(), TableError> {
        let text = |FirstError { text, mistake, count }| match mistake {
            Some(Mistake::FieldCount(_)) if count > 1 => format!("{text} (first of {count} such rows)"),
            Some(_) if count > 1 => format!("{text} (first of {count} such cells)"),
            _ => text,
        };
        let more = (self.more > 0).then(|| format!("and {} more", self.more));
        let place = self.path.display();
        let texts = self.list.into_iter().map(text).chain(more).map(|text| format!("{place}: {text}"));
        let texts: Vec<_> = texts.collect();
        if texts.is_empty() { Ok(()) } else { Err(TableError::Content(texts)) }
    }

    /// Every column to be read.
    fn columns(
        &mut self,
        line: u64,
        header: &[String],
        delimiter: &str,
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
            let shown = |names: &[String]| excerpt_of_length(&names.join(delimiter), MAX_HEADER_SHOWN);
            let found = match header {
                [] => "there is no header".into(),
                _ => format!("the header is \"{}\"", shown(header)),
            };
            let nearest = shown(&nearest_header(header, required));
            let is_angle = absent.iter().any(|name| name.starts_with("alpha"));
            let angles = if is_angle {
                ", with R = Rx(alpha) Ry(beta) Rz(gamma); --rotation names another order or quaternions"
            } else {
                ""
            };
            self.add(format!(
                "line {line}: missing columns {}: {found}; the nearest right one is \"{nearest}\"{angles}",
                absent.join(", ")
            ));
        } else if !optional_found.is_empty() && optional_found.len() < optional.len() {
            let absent = missing(optional).join(", ");
            self.add(format!(
                "line {line}: missing columns {absent}: of {} either all or none must be there",
                optional.join(", ")
            ));
        }
        columns.extend(optional_found);
        columns
    }

    /// Takes the units of a row that has these in place of numbers; whether it does.
    fn units(&mut self, record: &csv::ByteRecord, line: u64, columns: &mut [Column]) -> bool {
        let text = |column: &Column| cell(record.get(column.index).unwrap_or_default()).trim().to_string();
        let unit = |column: &Column| factor(&column.quantity, &text(column));
        if !columns.iter().any(|column| unit(column).is_some())
            || columns.iter().any(|column| number(&text(column), true).is_some())
        {
            return false;
        }
        for column in columns {
            let is_free = column.name == column.quantity;
            match unit(column) {
                Some(factor) if is_free || factor == column.factor => column.factor = factor,
                _ if text(column).is_empty() => {}
                _ => {
                    let bound =
                        if is_free { unit_names(&column.quantity) } else { "as in the header".into() };
                    let (name, unit) = (&column.name, text(column));
                    self.add(format!(
                        "line {line}: unit of {name} = \"{}\": must be {bound}",
                        excerpt(&unit)
                    ));
                }
            }
        }
        true
    }

    fn row(
        &mut self,
        record: &csv::ByteRecord,
        line: u64,
        width: usize,
        columns: &[Column],
        is_comma_decimal: bool,
    ) -> Option<Vec<f64>> {
        let count = record.len();
        if count != width {
            let cure = "; with decimal commas the fields must be separated by semicolons";
            let cure = if count > width && !is_comma_decimal { cure } else { "" };
            self.add_first(Some(Mistake::FieldCount(count)), || {
                format!("line {line}: {count} fields: must be {width}, as in the header{cure}")
            });
            return None;
        }
        let mut row = Vec::with_capacity(columns.len());
        for &Column { index: column, ref name, factor, .. } in columns {
            let text = cell(record.get(column).unwrap_or_default());
            let mistake = match number(text.trim(), is_comma_decimal).map(|value| value * factor) {
                Some(value) if value.abs() <= MAX_MAGNITUDE => {
                    row.push(value);
                    continue;
                }
                Some(value) if value.is_finite() => Mistake::Magnitude { column },
                Some(_) => Mistake::NotFinite { column },
                None => Mistake::NotANumber { column },
            };
            self.add_first(Some(mistake), || {
                let (text, place) = (excerpt(&text), format!("line {line}: {name}"));
                match mistake {
                    Mistake::NotANumber { .. } => format!("{place} = \"{text}\": must be a number"),
                    Mistake::NotFinite { .. } => format!("{place} = {text}: must be finite"),
                    _ => format!("{place} = {text}: must be at most {MAX_MAGNITUDE:e} in magnitude"),
                }
            });
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
