//! CSV tables of numbers, read with their columns by name.
//!
//! All errors of a file are reported at once (up to a limit), each with line, column, value and bound.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::csv_rows::CsvRows;
use super::excerpt::excerpt;
use super::files::FileError;
use super::numbers::{AXES, MAX_MAGNITUDE};

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
    /// Reads a CSV file, see [`NumberTable::from_reader`].
    pub fn read(path: &Path, required: &[String], optional: &[String]) -> Result<Self, TableError> {
        let file = File::open(path).map_err(FileError::on(path))?;
        Self::from_reader(file, path, required, optional)
    }

    /// Reads the named columns of CSV text, in this order, whatever the order in the text, and ignores other columns.
    /// Every number must be finite and at most 1e12 in magnitude. Error texts name the source `path`.
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
        if let Err(error) = table.fill(&mut CsvRows::new(source), required, optional, &mut errors) {
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
        let mut read = 0;
        while let Some((line, record)) = source.next_row()? {
            if read == MAX_ROWS {
                return Err(format!("line {line}: a row after {MAX_ROWS}: must be at most those"));
            }
            read += 1;
            if let Some(row) = errors.row(record, line, header.len(), &columns) {
                self.rows.push(row);
                self.lines.push(line);
            }
        }
        Ok(())
    }

    /// The rows, each with the requested columns.
    pub fn rows(&self) -> &[Vec<f64>] {
        &self.rows
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

    /// Index and name of every column to be read.
    fn columns(
        &mut self,
        line: u64,
        header: &[String],
        required: &[String],
        optional: &[String],
    ) -> Vec<(usize, String)> {
        let place = |name: &String| header.iter().position(|found| found == name);
        let found = |names: &[String]| -> Vec<_> {
            names.iter().filter_map(|name| Some((place(name)?, name.clone()))).collect()
        };
        let missing: Vec<_> = required.iter().filter(|name| place(name).is_none()).cloned().collect();
        if !missing.is_empty() {
            self.add(format!("line {line}: missing columns {}", missing.join(", ")));
        }
        for name in required.iter().chain(optional) {
            let times = header.iter().filter(|found| *found == name).count();
            if times > 1 {
                self.add(format!("line {line}: column {name} appears {times} times: must appear once"));
            }
        }
        let optional_found = found(optional);
        if !optional_found.is_empty() && optional_found.len() < optional.len() {
            let names = optional.join(", ");
            self.add(format!("line {line}: of the columns {names} either all or none must be there"));
        }
        let mut columns = found(required);
        columns.extend(optional_found);
        columns
    }

    fn row(
        &mut self,
        record: &csv::ByteRecord,
        line: u64,
        width: usize,
        columns: &[(usize, String)],
    ) -> Option<Vec<f64>> {
        if record.len() != width {
            self.add(format!("line {line}: {} fields: must be {width}, as in the header", record.len()));
            return None;
        }
        let mut row = Vec::with_capacity(columns.len());
        for (index, name) in columns {
            let text = cell(record.get(*index).unwrap_or_default());
            match text.trim().parse::<f64>() {
                Ok(value) if value.abs() <= MAX_MAGNITUDE => row.push(value),
                Ok(value) => {
                    let finite = value.is_finite().then(|| format!("at most {MAX_MAGNITUDE:e} in magnitude"));
                    let bound = finite.unwrap_or("finite".into());
                    self.add(format!("line {line}: {name} = {}: must be {bound}", excerpt(&text)));
                }
                Err(_) => self.add(format!("line {line}: {name} = \"{}\": must be a number", excerpt(&text))),
            }
        }
        (row.len() == columns.len()).then_some(row)
    }
}

/// Names of six columns, `stem_1 ... stem_6`.
pub fn legs(stem: &str) -> Vec<String> {
    (1..=6).map(|leg| format!("{stem}_{leg}")).collect()
}

/// Names of the columns of X or a derivative, `alpha<suffix> ... z<suffix>`.
pub fn coordinates(suffix: &str) -> Vec<String> {
    AXES.iter().map(|name| format!("{name}{suffix}")).collect()
}

/// Names of the columns of a trajectory: `t`, X, X', X''.
pub fn trajectory_columns() -> Vec<String> {
    let mut columns = vec!["t".into()];
    for suffix in ["", "_rate", "_accel"] {
        columns.extend(coordinates(suffix));
    }
    columns
}

/// Names of the columns that forward kinematics needs: `t` and lengths.
pub fn length_columns() -> Vec<String> {
    let mut columns = vec!["t".into()];
    columns.extend(legs("length"));
    columns
}

/// Six consecutive columns of a row.
pub fn six(row: &[f64], first: usize) -> [f64; 6] {
    row.get(first..first + 6).and_then(|values| values.try_into().ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::io::repeat;

    use super::*;
    use crate::output::csv_rows::MAX_ROW_BYTES;

    /// Error text for CSV with the columns t and x.
    fn refusal(source: impl Read) -> String {
        let columns = ["t".into(), "x".into()];
        NumberTable::from_reader(source, Path::new("x.csv"), &columns, &[]).unwrap_err().to_string()
    }

    #[test]
    fn endless_text_is_refused() {
        for byte in *b"1\",\n\0" {
            let bound = "x.csv: line 1: a row longer than 65536 bytes: must be at most that long";
            assert_eq!(refusal(repeat(byte)), bound);
            let bound = "x.csv: line 2: a row longer than 65536 bytes: must be at most that long";
            assert_eq!(refusal(b"t,x\n".chain(repeat(byte))), bound);
        }
        // A quote that is not closed, below a sound row.
        let bound = "x.csv: line 3: a row longer than 65536 bytes: must be at most that long";
        assert_eq!(refusal(b"t,x\n1,2\n\"1,".chain(repeat(b'2'))), bound);
    }

    #[test]
    fn a_long_row_is_read_to_its_bound() {
        let columns = ["t".into(), "x".into()];
        let rows = |notes: usize| format!("t,x,notes\n1,2,{}\n", "n".repeat(notes));
        let read =
            |text: String| NumberTable::from_reader(text.as_bytes(), Path::new("x.csv"), &columns, &[]);
        assert_eq!(read(rows(MAX_ROW_BYTES - 5)).unwrap().rows(), [[1.0, 2.0]]);
        assert!(read(rows(2 * MAX_ROW_BYTES)).is_err());
    }

    #[test]
    fn rows_without_end_are_refused() {
        struct EndlessRows;
        impl Read for EndlessRows {
            fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
                for (i, byte) in buffer.iter_mut().enumerate() {
                    *byte = if i % 2 == 0 { b'1' } else { b'\n' };
                }
                Ok(buffer.len() & !1)
            }
        }
        let message = refusal(b"t,x\n".chain(EndlessRows));
        assert!(message.starts_with("x.csv: line 2: 1 fields: must be 2, as in the header\n"), "{message}");
        assert!(
            message.ends_with(&format!("\nx.csv: and {} more", MAX_ROWS + 1 - MAX_ERRORS_SHOWN)),
            "{message}"
        );
    }

    #[test]
    fn values_are_shown_cut_and_on_one_line() {
        let text = format!("t,x\n1,\"1\n\u{1b}[2J\"\n2,{}\n3,-1e13\n", "9".repeat(400));
        let wanted = [
            "x.csv: line 2: x = \"1 \\u{1b}[2J\": must be a number",
            &format!("x.csv: line 4: x = {}...: must be finite", "9".repeat(60)),
            "x.csv: line 5: x = -1e13: must be at most 1e12 in magnitude",
        ];
        assert_eq!(refusal(text.as_bytes()), wanted.join("\n"));
    }

    #[test]
    fn errors_of_the_header_name_its_line() {
        for text in ["\nt,y\n", "\r\nt,y\r\n", "\nt,y"] {
            assert_eq!(refusal(text.as_bytes()), "x.csv: line 2: missing columns x");
        }
    }

    #[test]
    fn each_row_has_its_line() {
        let columns = ["t".into(), "x".into()];
        for end in ["\n", "\r\n"] {
            let text = "t,x\n1,2\n\n3,\"4\n\"\n5,\"6\"\n\n\n7,8".replace('\n', end);
            for text in [text.clone(), text + end] {
                let table =
                    NumberTable::from_reader(text.as_bytes(), Path::new("x.csv"), &columns, &[]).unwrap();
                assert_eq!(table.lines(), [2, 4, 6, 9], "{text:?}");
                assert_eq!(table.rows(), [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]);
            }
        }
    }
}
