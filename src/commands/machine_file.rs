//! New machine file: the text of the file in force with other numbers, or with a frame.
//!
//! The parser locates each number; only those characters, and a comment behind them, are replaced. So order, comments,
//! indentation, line ends and every other number stay as they are.

use core::ops::Range;
use std::collections::BTreeMap;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use self::change_comment::ChangeComment;
pub use self::difference::{changed_margins, difference};
use self::estimate::array;
pub use self::estimate::{Estimate, NewNumbers, NewValue};
pub use self::frame::with_frame;
use super::failure::CommandError;
use hexad_machine::config::number;
use hexad_machine::text::files::{FileError, is_standard, write_whole};

mod change_comment;
mod difference;
mod estimate;
mod frame;
#[cfg(test)]
mod tests;

/// Type of a value that a new value replaces.
const NUMERIC: &str = "a number or an array of numbers";

/// Error of writing a new machine file.
#[derive(Debug, thiserror::Error)]
pub enum MachineFileError {
    /// The text, or what the new values make of it, is not TOML.
    #[error("machine file: {message}; correct it, or enter the new values by hand")]
    Syntax {
        /// Error of the parser.
        message: String,
    },
    /// A new value belongs where the file has a value of another type.
    #[error(
        "{key} is of type {found} in the machine file, must be {expected}; correct it, or enter the new value by hand"
    )]
    Type {
        /// Full name of the key.
        key: String,
        /// Type of its value.
        found: &'static str,
        /// Type that a new value can replace.
        expected: &'static str,
    },
    /// A new value or its deviation is infinite or NaN.
    #[error("estimate of {key} must be finite; keep the old value")]
    NotFinite {
        /// Full name of the key.
        key: String,
    },
    /// The output exists.
    #[error("{place} exists already; name another file with --output, or remove it")]
    Exists {
        /// The file, as given.
        place: String,
    },
    /// Error of the file system.
    #[error(transparent)]
    File(#[from] FileError),
}

impl CommandError for MachineFileError {}

/// Text of a machine file with new values.
///
/// A number that equals its estimate but for digits that the deviation does not justify stays. A missing key is
/// added at the end of its section, a missing section at the end of the file.
pub fn edited(text: &str, values: &[NewValue]) -> Result<String, MachineFileError> {
    let root = parsed(text)?;
    let mut edits = Edits::new(text);
    values.iter().try_for_each(|value| edits.add(root.get_ref(), value))?;
    let edited = edits.apply();
    parsed(&edited)?;
    Ok(edited)
}

/// Writes a new machine file durably, completely or not at all. A file that exists stays as it is, above all the one in
/// force. `-` is standard output.
pub fn write_new(path: &Path, text: &str) -> Result<(), MachineFileError> {
    if !is_standard(path) && path.symlink_metadata().is_ok() {
        return Err(MachineFileError::Exists { place: path.display().to_string() });
    }
    Ok(write_whole(path, text.as_bytes())?)
}

fn parsed(text: &str) -> Result<Spanned<DeTable<'_>>, MachineFileError> {
    DeTable::parse(text).map_err(|error| MachineFileError::Syntax { message: error.message().into() })
}

/// Edits of a text.
struct Edits<'t> {
    text: &'t str,
    line_end: &'static str,
    replacements: Vec<(Range<usize>, String)>,
    /// Comments by the end of the value in front of them.
    comments: BTreeMap<usize, ChangeComment>,
    /// New lines by the end of the line above them.
    lines: Vec<(usize, String)>,
    /// Lines of new sections by header.
    sections: BTreeMap<String, String>,
}

/// Table in which a new value belongs.
struct Place<'r> {
    table: &'r DeTable<'r>,
    /// Span of the table: of its header, of the whole table if it is inline, of a key if it has no header.
    span: Range<usize>,
    /// If it is inline, or within an inline table: the end of the outermost one, and how many keys lead to that.
    inline: Option<(usize, usize)>,
}

impl<'t> Edits<'t> {
    fn new(text: &'t str) -> Self {
        let line_end = if text.contains("\r\n") { "\r\n" } else { "\n" };
        let (replacements, lines) = Default::default();
        Self { text, line_end, replacements, lines, comments: BTreeMap::new(), sections: BTreeMap::new() }
    }

    fn add(&mut self, root: &DeTable, new: &NewValue) -> Result<(), MachineFileError> {
        let key = || new.path.join(".");
        let is_finite = |estimate: &Estimate| estimate.value.is_finite() && estimate.deviation.is_finite();
        if !new.value.estimates().iter().all(is_finite) {
            return Err(MachineFileError::NotFinite { key: key() });
        }
        let mut place = Place { table: root, span: 0..0, inline: None };
        for (depth, name) in new.path.iter().enumerate() {
            let Some(value) = place.table.get(*name) else {
                self.insert(&place, new, depth);
                return Ok(());
            };
            let DeValue::Table(table) = value.get_ref() else {
                let is_last = depth + 1 == new.path.len();
                let expected = if is_last { NUMERIC } else { "a table" };
                let replaced = if is_last { self.replace(&place, new, value) } else { None };
                let found = value.get_ref().type_str();
                return replaced.ok_or_else(|| MachineFileError::Type { key: key(), found, expected });
            };
            let inline = self.is_inline(value).then(|| (value.span().end, depth + 1));
            place = Place { table, span: value.span(), inline: place.inline.or(inline) };
        }
        Err(MachineFileError::Type { key: key(), found: "table", expected: NUMERIC })
    }

    /// Replaces the numbers of a value that differ from their estimates. Returns `None` if the value is not numeric.
    fn replace(&mut self, place: &Place, new: &NewValue, value: &Spanned<DeValue>) -> Option<()> {
        let items = match value.get_ref() {
            DeValue::Array(items) => items.iter().collect(),
            _ => vec![value],
        };
        let numbers: Vec<f64> = items.iter().map(|item| number(item.get_ref())).collect::<Option<_>>()?;
        let estimates = new.value.estimates();
        let was_array = value.get_ref().is_array();
        let is_array = matches!(new.value, NewNumbers::Array(_));
        let texts = items.iter().map(|item| self.text.get(item.span()).unwrap_or_default().to_string());
        let old = if was_array { array(texts) } else { texts.collect() };
        let before = self.replacements.len();
        if was_array == is_array && numbers.len() == estimates.len() {
            let pairs = items.iter().zip(&numbers).zip(estimates);
            let changed = pairs.filter(|((_, number), estimate)| !estimate.is_equal_to(**number));
            self.replacements.extend(changed.map(|((item, _), estimate)| (item.span(), estimate.toml())));
        } else if was_array == is_array
            || !estimates.iter().all(|new| numbers.iter().all(|old| new.is_equal_to(*old)))
        {
            self.replacements.push((value.span(), new.value.toml()));
        }
        if self.replacements.len() > before {
            let (end, depth) = place.inline.unwrap_or((value.span().end, new.path.len()));
            self.comment(end, new, depth, Some(old));
        }
        Some(())
    }

    /// Inserts a key that the table, `depth` keys below the top, does not have.
    fn insert(&mut self, place: &Place, new: &NewValue, depth: usize) {
        let names = new.path.get(depth..).unwrap_or_default();
        let assignment = format!("{} = {}", names.join("."), new.value.toml());
        let values = place.table.iter().filter(|(_, value)| !self.has_header(value));
        let last = values.max_by_key(|(_, value)| value.span().end);
        if let Some((end, depth)) = place.inline {
            let (at, separator) =
                last.map_or((place.span.start + 1, " "), |(_, value)| (value.span().end, ", "));
            self.replacements.push((at..at, format!("{separator}{assignment}")));
            self.comment(end, new, depth, None);
            return;
        }
        let mut comment = ChangeComment::default();
        comment.add("", None, new.value.deviations());
        let line = |prefix: &str, assignment: &str| {
            format!("{}{prefix}{assignment}{}", self.line_end, comment.after(""))
        };
        match (names, last) {
            (&[_], Some((key, value))) => {
                // Indentation, and the keys in front if they are dotted.
                let above = self.text.get(..key.span().start).unwrap_or_default();
                let prefix = above.rsplit('\n').next().unwrap_or_default();
                self.lines.push((self.end_of_line(value.span().end), line(prefix, &assignment)));
            }
            (&[_], None) if self.starts_with(&place.span, '[') => {
                self.lines.push((self.end_of_line(place.span.end), line("", &assignment)));
            }
            _ => {
                let (name, header) = new.path.split_last().unwrap_or((&"", &[]));
                let line = line("", &format!("{name} = {}", new.value.toml()));
                *self.sections.entry(header.join(".")).or_default() += &line;
            }
        }
    }

    fn comment(&mut self, end: usize, new: &NewValue, depth: usize, old: Option<String>) {
        let key = new.path.get(depth..).unwrap_or_default().join(".");
        self.comments.entry(end).or_default().add(&key, old, new.value.deviations());
    }

    /// The edited text.
    fn apply(mut self) -> String {
        for (end, comment) in &self.comments {
            let rest = *end..self.end_of_line(*end);
            let changed = comment.after(self.text.get(rest.clone()).unwrap_or_default());
            self.replacements.push((rest, changed));
        }
        self.replacements.extend(self.lines.into_iter().map(|(at, line)| (at..at, line)));
        self.replacements.sort_by_key(|(range, _)| range.start);
        let (mut edited, mut end) = (String::new(), 0);
        for (range, replacement) in self.replacements {
            edited += self.text.get(end..range.start).unwrap_or_default();
            edited += &replacement;
            end = range.end;
        }
        edited += self.text.get(end..).unwrap_or_default();
        for (header, lines) in self.sections {
            let ends_line = edited.ends_with('\n');
            let [before, after] = if ends_line { ["", self.line_end] } else { [self.line_end, ""] };
            edited += &format!("{before}{}[{header}]{lines}{after}", self.line_end);
        }
        edited
    }

    fn end_of_line(&self, from: usize) -> usize {
        let rest = self.text.get(from..).unwrap_or_default();
        from + rest.lines().next().map_or(0, str::len)
    }

    fn starts_with(&self, span: &Range<usize>, first: char) -> bool {
        self.text.get(span.clone()).is_some_and(|text| text.starts_with(first))
    }

    fn is_inline(&self, value: &Spanned<DeValue>) -> bool {
        self.starts_with(&value.span(), '{')
    }

    /// Whether a value is a section, or an array of sections, rather than a value behind a key.
    fn has_header(&self, value: &Spanned<DeValue>) -> bool {
        match value.get_ref() {
            DeValue::Table(_) => !self.is_inline(value),
            DeValue::Array(items) => {
                items.first().is_some_and(|item| item.span().start == value.span().start)
            }
            _ => false,
        }
    }
}
