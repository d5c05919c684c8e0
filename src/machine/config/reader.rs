//! Reader of the keys of a section. It logs every violation.
//!
//! A key may be missing, of the wrong type or out of bounds. Its method then logs a violation and returns NaN, or the
//! default if the type has no NaN. So a caller never stops at the first error; it continues with NaN. A check that
//! compares several values must pass NaN, because the cause has been logged already.

use core::cell::RefCell;
use core::fmt;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::bound::{Bound, integer, number};
use super::{MAX_VIOLATIONS, Violation};
use crate::text::excerpt::excerpt;
use crate::text::nearest::nearest;
use hexad_core::model::LEGS;

/// Log of the violations in a text, shared by the readers of all its sections.
pub(super) struct ViolationLog<'t> {
    text: &'t str,
    /// Offsets of the ends of its lines.
    ends: Vec<usize>,
    /// Whether lines were blanked. A missing key may be on one of them, so no key counts as missing.
    incomplete: bool,
    violations: RefCell<Vec<Violation>>,
}

/// Reader of one section.
pub(super) struct SectionReader<'t> {
    log: &'t ViolationLog<'t>,
    /// Name of the section, empty at the root.
    path: String,
    line: usize,
    /// The section; `None` if it is missing, which is a violation only for keys without a default.
    table: Option<&'t DeTable<'t>>,
    /// Whether the value is not a table. This has been logged, so its keys do not count as missing.
    is_malformed: bool,
    /// Known keys, and their defaults as shown in error texts. All others are violations.
    known: Vec<(&'static str, Option<String>)>,
}

impl<'t> ViolationLog<'t> {
    /// Log for a text, beginning with its syntax errors.
    pub fn new(text: &'t str, syntax_errors: Vec<Violation>) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(i, _)| i).collect();
        let incomplete = !syntax_errors.is_empty();
        Self { text, ends, incomplete, violations: RefCell::new(syntax_errors) }
    }

    /// The violations in the order of the lines; the last entry counts those beyond the largest number shown.
    pub fn into_violations(self) -> Vec<Violation> {
        let mut violations = self.violations.into_inner();
        violations.sort_by_key(|violation| violation.line);
        let more = violations.len().saturating_sub(MAX_VIOLATIONS);
        violations.truncate(MAX_VIOLATIONS);
        if let (1.., Some(last)) = (more, violations.last()) {
            let bound = format!("not shown, as {MAX_VIOLATIONS} are");
            let key = format!("and {more} more");
            violations.push(Violation { line: last.line, key, value: None, bound });
        }
        violations
    }

    fn line(&self, offset: usize) -> usize {
        1 + self.ends.partition_point(|end| *end < offset)
    }

    /// A value as written, on one line; `None` for a section that a header opens.
    fn shown(&self, value: &Spanned<DeValue>) -> Option<String> {
        let span = value.span();
        let by_header = match value.get_ref() {
            DeValue::Table(_) => !self.text.get(span.clone())?.starts_with('{'),
            DeValue::Array(items) => items.first().is_some_and(|item| item.span().start == span.start),
            _ => false,
        };
        if by_header { None } else { self.text.get(span).map(excerpt) }
    }
}

impl<'t> SectionReader<'t> {
    /// Reader of the top level of a file.
    pub fn root(log: &'t ViolationLog<'t>, table: &'t DeTable<'t>) -> Self {
        Self { log, path: String::new(), line: 1, table: Some(table), is_malformed: false, known: Vec::new() }
    }

    /// A required number.
    pub fn number(&mut self, key: &'static str, bound: Bound) -> f64 {
        self.required(key, bound).map_or(f64::NAN, |value| self.checked(self.key(key), value, bound))
    }

    /// A number with a default.
    pub fn number_or(&mut self, key: &'static str, default: f64, bound: Bound) -> f64 {
        let found = self.find(key, Some(default.to_string()));
        found.map_or(default, |value| self.checked(self.key(key), value, bound))
    }

    /// A number that has no bound by default.
    pub fn optional_number(&mut self, key: &'static str, bound: Bound) -> Option<f64> {
        Some(self.number_or(key, f64::INFINITY, bound)).filter(|number| number.is_finite())
    }

    /// A number for all legs, or an array with one per leg; with a default.
    pub fn per_leg_or(&mut self, key: &'static str, default: f64, bound: Bound) -> [f64; LEGS] {
        let Some(value) = self.find(key, Some(default.to_string())) else { return [default; LEGS] };
        match value.get_ref() {
            DeValue::Array(items) if items.len() == LEGS => self.components(key, value, &[bound; LEGS]),
            DeValue::Integer(_) | DeValue::Float(_) => [self.checked(self.key(key), value, bound); LEGS],
            _ => {
                self.reject(key, format!("must be a number, or an array of {LEGS} numbers, one per leg"));
                [f64::NAN; LEGS]
            }
        }
    }

    /// An optional integer in `[low, high]`.
    pub fn integer(&mut self, key: &'static str, low: i32, high: i32) -> Option<i32> {
        self.find(key, None).and_then(|value| self.checked_integer(key, value, low, high))
    }

    /// An integer in `[low, high]` with a default.
    pub fn integer_or(&mut self, key: &'static str, default: i32, low: i32, high: i32) -> i32 {
        let found = self.find(key, Some(default.to_string()));
        found.and_then(|value| self.checked_integer(key, value, low, high)).unwrap_or(default)
    }

    /// `true` or `false`, with a default.
    pub fn flag_or(&mut self, key: &'static str, default: bool) -> bool {
        let Some(value) = self.find(key, Some(default.to_string())) else { return default };
        let flag = value.get_ref().as_bool();
        if flag.is_none() {
            self.reject(key, "must be true or false");
        }
        flag.unwrap_or(default)
    }

    /// One of several names, with a default.
    pub fn choice_or<T: Copy>(&mut self, key: &'static str, default: T, options: &[(&str, T)]) -> T {
        let Some(value) = self.find(key, None) else { return default };
        self.checked_choice(key, value, options).unwrap_or(default)
    }

    /// One of several names; required.
    pub fn choice<T: Copy>(&mut self, key: &'static str, options: &[(&str, T)]) -> Option<T> {
        self.required(key, choice_bound(options)).and_then(|value| self.checked_choice(key, value, options))
    }

    /// A required name of letters, digits, `_` and `-`.
    pub fn name(&mut self, key: &'static str, longest: usize) -> String {
        let found = self.required(key, name_bound(longest));
        found.map(|value| self.checked_name(key, value, longest)).unwrap_or_default()
    }

    /// An optional name of letters, digits, `_` and `-`.
    pub fn optional_name(&mut self, key: &'static str, longest: usize) -> Option<String> {
        self.find(key, None).map(|value| self.checked_name(key, value, longest))
    }

    /// `N` required finite numbers.
    pub fn vector<const N: usize>(&mut self, key: &'static str) -> [f64; N] {
        let found = self.required(key, format!("an array of {N} numbers"));
        found.map_or([f64::NAN; N], |value| self.components(key, value, &[Bound::Finite; N]))
    }

    /// `N` finite numbers with a default.
    pub fn vector_or<const N: usize>(&mut self, key: &'static str, default: [f64; N]) -> [f64; N] {
        let found = self.find(key, Some(format!("{default:?}")));
        found.map_or(default, |value| self.components(key, value, &[Bound::Finite; N]))
    }

    /// `N` optional numbers, each with its bound.
    pub fn vector_within<const N: usize>(
        &mut self,
        key: &'static str,
        bounds: &[Bound; N],
    ) -> Option<[f64; N]> {
        self.find(key, None).map(|value| self.components(key, value, bounds))
    }

    /// Whether the section has a value for `key`.
    pub fn has(&self, key: &str) -> bool {
        self.value(key).is_some()
    }

    /// Whether the value of `key` is a table, for keys that may also be a number.
    pub fn is_table(&self, key: &str) -> bool {
        self.value(key).is_some_and(|value| value.get_ref().is_table())
    }

    /// Reader of a subsection.
    pub fn section(&mut self, key: &'static str) -> Self {
        let found = self.find(key, None);
        self.child(self.key(key), found)
    }

    /// Readers of `count` sections with the same header. Returns one per section found, at most as many as violations
    /// can be shown.
    pub fn rows(&mut self, key: &'static str, count: usize) -> Vec<Self> {
        let bound = format!("{count} sections headed [[{key}]]");
        let Some(value) = self.required(key, &bound) else { return Vec::new() };
        let Some(rows) = value.get_ref().as_array() else {
            self.reject(key, format!("must be {bound}"));
            return Vec::new();
        };
        if rows.len() > count || rows.len() < count && !self.log.incomplete {
            self.reject_as(key, format!("{} sections", rows.len()), format!("must be {bound}"));
        }
        self.children(key, rows.iter().take(MAX_VIOLATIONS))
    }

    /// Readers of any number of sections with the same header.
    pub fn optional_rows(&mut self, key: &'static str) -> Vec<Self> {
        let Some(value) = self.find(key, None) else { return Vec::new() };
        let Some(rows) = value.get_ref().as_array() else {
            self.reject(key, format!("must be sections headed [[{key}]]"));
            return Vec::new();
        };
        self.children(key, rows.iter())
    }

    /// Logs a violation by the value of `key`, as written or by default.
    pub fn reject(&self, key: &str, bound: impl Into<String>) {
        let value = match self.value(key) {
            Some(value) => self.log.shown(value),
            None => self.default_of(key).map(|default| format!("{default} (default)")),
        };
        self.add(self.line_of(key), self.key(key), value, bound.into());
    }

    /// Logs a violation by `value`, which is derived from the value of `key`.
    pub fn reject_as(&self, key: &str, value: impl Into<String>, bound: impl Into<String>) {
        self.add(self.line_of(key), self.key(key), Some(value.into()), bound.into());
    }

    /// Logs a violation by the section as a whole.
    pub fn reject_section(&self, value: impl Into<String>, bound: impl Into<String>) {
        self.add(self.line, self.path.clone(), Some(value.into()), bound.into());
    }

    /// Ends the reader, whatever other keys the section has.
    pub fn ignore_others(mut self) {
        self.table = None;
    }

    fn children(&self, key: &str, rows: impl Iterator<Item = &'t Spanned<DeValue<'t>>>) -> Vec<Self> {
        let row = |(i, row)| self.child(format!("{}[{}]", self.key(key), i + 1), Some(row));
        rows.enumerate().map(row).collect()
    }

    fn child(&self, path: String, value: Option<&'t Spanned<DeValue<'t>>>) -> Self {
        let line = value.map_or(self.line, |value| self.log.line(value.span().start));
        let table = value.and_then(|value| value.get_ref().as_table());
        let is_malformed = self.is_malformed || value.is_some() && table.is_none();
        if let (Some(value), None) = (value, table) {
            self.add(line, path.clone(), self.log.shown(value), "must be a table".into());
        }
        Self { log: self.log, path, line, table, is_malformed, known: Vec::new() }
    }

    fn value(&self, key: &str) -> Option<&'t Spanned<DeValue<'t>>> {
        self.table?.get(key)
    }

    fn find(&mut self, key: &'static str, default: Option<String>) -> Option<&'t Spanned<DeValue<'t>>> {
        self.known.push((key, default));
        self.value(key)
    }

    fn required(&mut self, key: &'static str, bound: impl fmt::Display) -> Option<&'t Spanned<DeValue<'t>>> {
        let found = self.find(key, None);
        if found.is_none() && !self.is_malformed && !self.log.incomplete {
            self.add(self.line, self.key(key), None, format!("missing, must be {bound}"));
        }
        found
    }

    fn checked(&self, path: String, value: &Spanned<DeValue>, bound: Bound) -> f64 {
        let x = number(value.get_ref());
        let Some(violation) = bound.violation(x) else { return x.unwrap_or(f64::NAN) };
        self.add(self.log.line(value.span().start), path, self.log.shown(value), violation);
        f64::NAN
    }

    fn checked_name(&self, key: &str, value: &Spanned<DeValue>, longest: usize) -> String {
        let name = value.get_ref().as_str().unwrap_or_default();
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if name.is_empty() || name.len() > longest || !name.chars().all(plain) {
            self.reject(key, format!("must be {}", name_bound(longest)));
        }
        name.into()
    }

    fn checked_choice<T: Copy>(
        &self,
        key: &str,
        value: &Spanned<DeValue>,
        options: &[(&str, T)],
    ) -> Option<T> {
        let name = value.get_ref().as_str();
        let chosen = options.iter().find(|(option, _)| name == Some(option));
        if chosen.is_none() {
            self.reject(key, format!("must be {}", choice_bound(options)));
        }
        chosen.map(|(_, choice)| *choice)
    }

    fn checked_integer(&self, key: &str, value: &Spanned<DeValue>, low: i32, high: i32) -> Option<i32> {
        let x = integer(value.get_ref()).filter(|x| (low..=high).contains(x));
        if x.is_none() {
            self.reject(key, format!("must be an integer in [{low}, {high}]"));
        }
        x
    }

    fn components<const N: usize>(
        &self,
        key: &str,
        value: &Spanned<DeValue>,
        bounds: &[Bound; N],
    ) -> [f64; N] {
        let mut vector = [f64::NAN; N];
        match value.get_ref().as_array() {
            Some(items) if items.len() == N => {
                for (i, (slot, (item, bound))) in vector.iter_mut().zip(items.iter().zip(bounds)).enumerate()
                {
                    *slot = self.checked(format!("{}[{}]", self.key(key), i + 1), item, *bound);
                }
            }
            _ => self.reject(key, format!("must be an array of {N} numbers")),
        }
        vector
    }

    fn key(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    fn line_of(&self, key: &str) -> usize {
        self.value(key).map_or(self.line, |value| self.log.line(value.span().start))
    }

    fn default_of(&self, key: &str) -> Option<&String> {
        self.known.iter().find(|(known, _)| *known == key)?.1.as_ref()
    }

    fn add(&self, line: usize, key: String, value: Option<String>, bound: String) {
        self.log.violations.borrow_mut().push(Violation { line, key, value, bound });
    }
}

/// At its end a reader logs a violation for each key that it does not know.
impl Drop for SectionReader<'_> {
    fn drop(&mut self) {
        let known: Vec<&str> = self.known.iter().map(|(key, _)| *key).collect();
        for (key, value) in self.table.into_iter().flatten() {
            if !known.contains(&key.get_ref().as_ref()) {
                let probable = nearest(key.get_ref(), &known).map(|name| format!(" probably {name},"));
                let bound = format!(
                    "unknown key,{} must be one of: {}",
                    probable.unwrap_or_default(),
                    known.join(", ")
                );
                let line = self.log.line(key.span().start);
                self.add(line, self.key(&excerpt(key.get_ref())), self.log.shown(value), bound);
            }
        }
    }
}

fn choice_bound<T>(options: &[(&str, T)]) -> String {
    let names: Vec<_> = options.iter().map(|(option, _)| format!("\"{option}\"")).collect();
    format!("one of {}", names.join(", "))
}

fn name_bound(longest: usize) -> String {
    format!("a name of 1 to {longest} characters, each one of A-Z a-z 0-9 _ -")
}
