//! CSV tables of numbers: columns by name in, shortest digits that read back the same out.
//!
//! Everything wrong with a file is reported at once (up to a limit), each with line, column, value and
//! bound.

extern crate std;

use core::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::prelude::rust_2024::*;
use std::{format, vec};

use super::files::{FileError, write_whole};

/// Complaints shown for one file; a file with more has one mistake many times.
const MAX_COMPLAINTS: usize = 20;

/// Why a table could not be read.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{}", .complaints.join("\n"))]
    Content { complaints: Vec<String> },
}

/// Numbers by row and column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads the named columns of a CSV file, in this order, whatever the order in the file. Other columns
    /// are passed over. Every number must be finite.
    ///
    /// `optional` columns come after the required ones if the file has all of them.
    pub fn read(path: &Path, required: &[String], optional: &[String]) -> Result<Self, TableError> {
        let file = std::fs::File::open(path).map_err(FileError::on(path))?;
        let mut reader = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(file);
        let mut complaints = Complaints { path: path.into(), list: vec![], more: 0 };
        let header = match reader.headers() {
            Ok(header) => header.clone(),
            Err(error) => return Err(complaints.one(format!("header: {error}"))),
        };
        let columns = complaints.columns(&header, required, optional);
        if !complaints.list.is_empty() {
            return Err(complaints.into());
        }
        let mut rows = vec![];
        for record in reader.records() {
            match record {
                Ok(record) => rows.extend(complaints.row(&record, header.len(), &columns)),
                Err(error) => complaints.add(format!("{error}")),
            }
        }
        if rows.is_empty() && complaints.list.is_empty() {
            complaints.add("no rows: must have at least one".into());
        }
        if complaints.list.is_empty() { Ok(Self { rows }) } else { Err(complaints.into()) }
    }

    /// The rows, each with the columns asked for.
    pub fn rows(&self) -> &[Vec<f64>] {
        &self.rows
    }
}

/// Collects what is wrong with one file.
struct Complaints {
    path: PathBuf,
    list: Vec<String>,
    more: usize,
}

impl Complaints {
    fn add(&mut self, what: String) {
        if self.list.len() < MAX_COMPLAINTS {
            self.list.push(format!("{}: {what}", self.path.display()));
        } else {
            self.more += 1;
        }
    }

    fn one(mut self, what: String) -> TableError {
        self.add(what);
        self.into()
    }

    /// Index and name of every column to be read.
    fn columns(
        &mut self,
        header: &csv::StringRecord,
        required: &[String],
        optional: &[String],
    ) -> Vec<(usize, String)> {
        let place = |name: &String| header.iter().position(|found| found == name);
        let found = |names: &[String]| -> Vec<_> {
            names.iter().filter_map(|name| Some((place(name)?, name.clone()))).collect()
        };
        let missing: Vec<_> = required.iter().filter(|name| place(name).is_none()).cloned().collect();
        if !missing.is_empty() {
            self.add(format!("line 1: missing columns {}", missing.join(", ")));
        }
        for name in required.iter().chain(optional) {
            let times = header.iter().filter(|found| found == name).count();
            if times > 1 {
                self.add(format!("line 1: column {name} appears {times} times: must appear once"));
            }
        }
        let optional_found = found(optional);
        if !optional_found.is_empty() && optional_found.len() < optional.len() {
            let names = optional.join(", ");
            self.add(format!("line 1: of the columns {names} either all or none must be there"));
        }
        let mut columns = found(required);
        columns.extend(optional_found);
        columns
    }

    fn row(
        &mut self,
        record: &csv::StringRecord,
        width: usize,
        columns: &[(usize, String)],
    ) -> Option<Vec<f64>> {
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != width {
            self.add(format!("line {line}: {} fields: must be {width}, as in the header", record.len()));
            return None;
        }
        let mut row = Vec::with_capacity(columns.len());
        for (index, name) in columns {
            let text = record.get(*index).unwrap_or_default();
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => row.push(value),
                Ok(_) => self.add(format!("line {line}: {name} = {text}: must be finite")),
                Err(_) => self.add(format!("line {line}: {name} = {text:?}: must be a number")),
            }
        }
        (row.len() == columns.len()).then_some(row)
    }
}

impl From<Complaints> for TableError {
    fn from(mut complaints: Complaints) -> Self {
        if complaints.more > 0 {
            let more = complaints.more;
            complaints.list.push(format!("{}: and {more} more", complaints.path.display()));
        }
        Self::Content { complaints: complaints.list }
    }
}

/// Text of a CSV file in the making.
#[derive(Debug, Default)]
pub struct Writer {
    text: String,
}

impl Writer {
    /// Starts with the header.
    pub fn new(columns: &[String]) -> Self {
        let mut text = columns.join(",");
        text.push('\n');
        Self { text }
    }

    /// Adds a row. Numbers get the shortest digits that read back the same.
    pub fn row(&mut self, values: impl IntoIterator<Item = f64>) {
        let start = self.text.len();
        for value in values {
            if self.text.len() > start {
                self.text.push(',');
            }
            // Debug is the shortest round trip, with an exponent where that is shorter. A String takes all.
            let _ = write!(self.text, "{value:?}");
        }
        self.text.push('\n');
    }

    /// Writes the file, whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        write_whole(path, self.text.as_bytes())
    }
}

/// `stem_1 ... stem_6`.
pub fn legs(stem: &str) -> Vec<String> {
    (1..=6).map(|leg| format!("{stem}_{leg}")).collect()
}

/// `alpha<suffix> ... z<suffix>`.
pub fn coordinates(suffix: &str) -> Vec<String> {
    ["alpha", "beta", "gamma", "x", "y", "z"].iter().map(|name| format!("{name}{suffix}")).collect()
}

/// `t`, X, X', X'': the columns of a trajectory.
pub fn trajectory_columns() -> Vec<String> {
    let mut columns = vec!["t".into()];
    for suffix in ["", "_rate", "_accel"] {
        columns.extend(coordinates(suffix));
    }
    columns
}

/// Six consecutive columns of a row.
pub fn six(row: &[f64], first: usize) -> [f64; 6] {
    row.get(first..first + 6).and_then(|values| values.try_into().ok()).unwrap_or_default()
}
