//! Errors found in the content of one CSV file, and its columns and rows without them.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::text::csv_columns::{Column, factor, find, hint, nearest_header, unit_names};
use crate::text::excerpt::{excerpt, excerpt_of_length, stranger};
use crate::text::files::FileError;
use crate::text::numbers::MAX_MAGNITUDE;

/// Errors shown of one file; a file with more has one mistake many times.
const MAX_ERRORS_SHOWN: usize = 20;

/// Characters shown of a header. The header of a trajectory has 134 without units.
const MAX_HEADER_SHOWN: usize = 240;

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

/// Text of a field. Bytes that are not UTF-8 become a character that is part of no name and no number.
pub(super) fn cell(field: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(field)
}

/// Whether a row has no number in a column.
pub(super) fn is_absent(record: &csv::ByteRecord, column: &Column) -> bool {
    number(cell(record.get(column.index).unwrap_or_default()).trim(), false).is_some_and(f64::is_nan)
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
pub struct TableErrors {
    path: PathBuf,
    list: Vec<FirstError>,
    /// Errors beyond those in the list.
    more: usize,
}

impl TableErrors {
    /// None yet, of the file `path`.
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

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
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
    pub(super) fn columns(
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
            let mut absent: Vec<_> = absent.cloned().collect();
            // One is enough: the nearest right header shows the others.
            let hinted = absent.iter_mut().find_map(|name| Some((hint(header, name)?, name)));
            if let Some((hint, name)) = hinted {
                name.push_str(&hint);
            }
            absent
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
    pub(super) fn units(&mut self, record: &csv::ByteRecord, line: u64, columns: &mut [Column]) -> bool {
        let text = |column: &Column| cell(record.get(column.index).unwrap_or_default()).trim().to_string();
        let unit = |column: &Column| factor(&column.quantity, &text(column));
        if !columns.iter().any(|column| unit(column).is_some())
            || columns.iter().any(|column| number(&text(column), true).is_some())
        {
            return false;
        }
        for column in columns {
            let is_free = column.name.ends_with(&column.quantity);
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

    pub(super) fn row(
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
        for found @ &Column { index: column, ref name, factor, .. } in columns {
            let text = cell(record.get(column).unwrap_or_default());
            if found.may_be_empty() && text.trim().is_empty() {
                row.push(f64::NAN);
                continue;
            }
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
                let (stranger, text, place) =
                    (stranger(&text), excerpt(&text), format!("line {line}: {name}"));
                match mistake {
                    Mistake::NotANumber { .. } => format!("{place} = \"{text}\": must be a number{stranger}"),
                    Mistake::NotFinite { .. } => format!("{place} = {text}: must be finite"),
                    _ => format!("{place} = {text}: must be at most {MAX_MAGNITUDE:e} in magnitude"),
                }
            });
        }
        (row.len() == columns.len()).then_some(row)
    }
}
