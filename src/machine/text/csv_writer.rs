//! CSV text of numbers, with the shortest digits that read back the same.

use core::fmt::Write as _;
use std::path::Path;

use csv::Writer;

use super::files::{FileError, write_whole};

/// CSV text of a table of numbers, written row by row.
#[derive(Debug)]
pub struct CsvWriter {
    text: Writer<Vec<u8>>,
    field: String,
}

// Writing to memory cannot fail.
impl CsvWriter {
    /// Writer that has written the header.
    pub fn new(columns: &[String]) -> Self {
        let mut text = Writer::from_writer(vec![]);
        let _ = text.write_record(columns);
        Self { text, field: String::new() }
    }

    /// Adds a row. Numbers get the shortest digits that read back the same.
    pub fn row(&mut self, values: impl IntoIterator<Item = f64>) {
        self.row_with_names(values, []);
    }

    /// Adds a row of numbers, then names.
    pub fn row_with_names<'a>(
        &mut self,
        values: impl IntoIterator<Item = f64>,
        names: impl IntoIterator<Item = &'a str>,
    ) {
        for value in values {
            self.field.clear();
            // Debug is the shortest round trip, with an exponent where that is shorter.
            let _ = write!(self.field, "{value:?}");
            let _ = self.text.write_field(&self.field);
        }
        names.into_iter().for_each(|name| drop(self.text.write_field(name)));
        let _ = self.text.write_record(None::<&[u8]>);
    }

    /// The text so far.
    pub fn text(&mut self) -> &[u8] {
        let _ = self.text.flush();
        self.text.get_ref()
    }

    /// Writes the file, complete or not at all.
    pub fn save(&mut self, path: &Path) -> Result<(), FileError> {
        write_whole(path, self.text())
    }
}
