//! New machine file: the text of the file in force with other numbers, or with a frame.
//!
//! Only the numbers and the comments behind them are replaced. Order, other comments, indentation, line ends and every other
//! number stay as they are.

use std::path::Path;

use toml_edit::{Decor, DocumentMut, InlineTable, Item, Table, TableLike, Value};

use self::change_comment::ChangeComment;
pub use self::difference::{changed_margins, difference};
use self::estimate::array;
pub use self::estimate::{Estimate, NewNumbers, NewValue};
pub use self::frame::with_frame;
use super::failure::Failure;
use hexad_machine::text::files::{is_standard, write_whole};

mod change_comment;
mod difference;
mod estimate;
mod frame;
#[cfg(test)]
mod tests;

/// Type of a value that a new value replaces.
const NUMERIC: &str = "a number or an array of numbers";

/// Text of a machine file with new values.
///
/// A number that equals its estimate but for digits that the deviation does not justify stays. A missing key is
/// added at the end of its section, a missing section at the end of the file.
pub fn edited(text: &str, values: &[NewValue]) -> Result<String, Failure> {
    let mut document = parsed(text)?;
    for new in values {
        let is_finite = |estimate: &Estimate| estimate.value.is_finite() && estimate.deviation.is_finite();
        if !new.value.estimates().iter().all(is_finite) {
            let key = &new.key;
            return Err(Failure::before_start(format_args!(
                "estimate of {key} must be finite; keep the old value"
            )));
        }
        set(document.as_table_mut(), &new.key, new, false)?;
    }
    written(text, &document)
}

/// Writes a new machine file durably, completely or not at all. A file that exists stays as it is, above all the one in
/// force. `-` is standard output.
pub fn write_new(path: &Path, text: &str) -> Result<(), Failure> {
    if !is_standard(path) && path.symlink_metadata().is_ok() {
        let place = path.display();
        return Err(Failure::before_start(format_args!(
            "{place} exists already; name another file with --output, or remove it"
        )));
    }
    write_whole(path, text.as_bytes()).map_err(Failure::before_start)
}

fn parsed(text: &str) -> Result<DocumentMut, Failure> {
    text.parse().map_err(|error: toml_edit::TomlError| {
        let message = error.message();
        Failure::before_start(format_args!(
            "machine file: {message}; correct it, or enter the new values by hand"
        ))
    })
}

/// The document with the line ends of the text.
fn written(text: &str, document: &DocumentMut) -> Result<String, Failure> {
    let mut written = document.to_string();
    parsed(&written)?;
    if !text.ends_with('\n') && written.ends_with('\n') {
        written.pop();
    }
    Ok(if text.contains("\r\n") { written.replace('\n', "\r\n") } else { written })
}

/// A new value belongs where the file has a value of another type.
fn wrong_type(key: &str, found: &str, expected: &str) -> Failure {
    Failure::before_start(format_args!(
        "{key} is of type {found} in the machine file, must be {expected}; correct it, or enter the new value by hand"
    ))
}

/// What was changed: the old text of a value, `None` for a new one.
type Changed = Option<Option<String>>;

/// Sets the value at the end of a path below a table, with the comment behind the outermost value.
fn set(table: &mut dyn TableLike, path: &str, new: &NewValue, is_inline: bool) -> Result<Changed, Failure> {
    let (name, below) = path.split_once('.').unwrap_or((path, ""));
    if let Some((sections, number)) = name.strip_suffix(']').and_then(|name| name.split_once('[')) {
        return set(section(table, sections, number, new)?, below, new, false);
    }
    let of_type = |found: &Item, expected| wrong_type(&new.key, found.type_name(), expected);
    let is_new = !table.contains_key(name);
    if is_new {
        insert(table, name, !below.is_empty(), new, is_inline);
    }
    let Some(item) = table.get_mut(name) else { return Ok(None) };
    let changed = match below {
        "" if is_new => Some(None),
        "" => replace(item, new).ok_or_else(|| of_type(item, NUMERIC))?,
        _ => {
            let (is_inline, of_value) = (item.is_inline_table(), of_type(item, "a table"));
            set(item.as_table_like_mut().ok_or(of_value)?, below, new, is_inline)?
        }
    };
    if let (Some(old), Some(value), false) = (&changed, item.as_value_mut(), is_inline) {
        comment(value.decor_mut(), below, old.clone(), new);
    }
    Ok(changed)
}

/// One of several sections with the same name, by its number from 1: `leg[3]` is the third `[[leg]]`.
fn section<'t>(
    table: &'t mut dyn TableLike,
    name: &str,
    number: &str,
    new: &NewValue,
) -> Result<&'t mut dyn TableLike, Failure> {
    let found = table.get(name).map_or("none", Item::type_name);
    let index = number.parse().ok().and_then(|number: usize| number.checked_sub(1));
    let sections = table.get_mut(name).and_then(Item::as_array_of_tables_mut);
    let section = sections.zip(index).and_then(|(sections, index)| sections.get_mut(index));
    let expected = format!("an array of tables, [[{name}]]");
    section.map(|section| section as &mut dyn TableLike).ok_or_else(|| wrong_type(&new.key, found, &expected))
}

/// Adds a value, with the indentation of the key above, or a table.
fn insert(table: &mut dyn TableLike, name: &str, is_table: bool, new: &NewValue, is_inline: bool) {
    let above = table.iter().filter(|(_, item)| item.is_value()).last();
    let decor = above.and_then(|(above, _)| table.key(above)?.leaf_decor().prefix()?.as_str());
    let indentation = decor.and_then(|prefix| prefix.rsplit('\n').next()).map(String::from);
    let item = match (is_table, is_inline) {
        (true, true) => {
            let mut dotted = InlineTable::new();
            dotted.set_dotted(true);
            Value::from(dotted).into()
        }
        (true, false) => Table::new().into(),
        (false, _) => value_of(&new.value.toml()).into(),
    };
    table.insert(name, item);
    if is_inline {
        table.fmt();
    } else if let (Some(mut key), false) = (table.key_mut(name), is_table) {
        key.leaf_decor_mut().set_prefix(indentation.unwrap_or_default());
    }
}

/// Replaces the numbers of a value that differ from their estimates. Returns `None` if the value is not numeric.
fn replace(item: &mut Item, new: &NewValue) -> Option<Changed> {
    let value = item.as_value_mut()?;
    let (was_array, is_array) = (value.is_array(), matches!(new.value, NewNumbers::Array(_)));
    let items: Vec<&Value> = value.as_array().map_or_else(|| vec![&*value], |items| items.iter().collect());
    let numbers: Vec<f64> = items.iter().map(|item| number(item)).collect::<Option<_>>()?;
    let texts = items.iter().map(|item| (*item).clone().decorated("", "").to_string());
    let old = if was_array { array(texts) } else { texts.collect() };
    let estimates = new.value.estimates();
    let has_changed = if was_array == is_array && numbers.len() == estimates.len() {
        let places: Vec<&mut Value> = match value {
            Value::Array(items) => items.iter_mut().collect(),
            one => vec![one],
        };
        let pairs = places.into_iter().zip(numbers).zip(estimates);
        let changed = pairs.filter(|((_, number), estimate)| !estimate.is_equal_to(*number));
        changed.map(|((place, _), estimate)| exchange(place, &estimate.toml())).count() > 0
    } else {
        let is_equal = |new: &Estimate| numbers.iter().all(|old| new.is_equal_to(*old));
        let has_changed = was_array == is_array || !estimates.iter().all(is_equal);
        has_changed.then(|| exchange(value, &new.value.toml())).is_some()
    };
    Some(has_changed.then_some(Some(old)))
}

/// Replaces a value, with what is around it as before.
fn exchange(value: &mut Value, text: &str) {
    let decor = value.decor().clone();
    *value = value_of(text);
    *value.decor_mut() = decor;
}

/// A value from the text of numbers, which is valid.
fn value_of(text: &str) -> Value {
    text.parse().unwrap_or_else(|_| f64::NAN.into())
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or(value.as_integer().map(|x| x as f64))
}

/// Whether a machine file has a table at a key.
pub fn has_table(text: &str, key: &str) -> bool {
    let document = parsed(text).unwrap_or_default();
    key.split('.').try_fold(document.as_item(), |item, key| item.get(key)).is_some_and(Item::is_table_like)
}

fn comment(decor: &mut Decor, key: &str, old: Option<String>, new: &NewValue) {
    let mut comment = ChangeComment::default();
    comment.add(key, old, new.value.deviations());
    let rest = decor.suffix().and_then(|suffix| suffix.as_str()).unwrap_or_default();
    let changed = comment.after(rest);
    decor.set_suffix(changed);
}
