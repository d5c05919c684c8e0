//! Recovery of the sound lines of a file with syntax errors.
//!
//! The TOML parser recovers from most errors but skips the rest of the file after a key without `=`, and after an
//! unclosed bracket it reports every line. So: take the first error, blank the line that caused it, parse again. One
//! mistake then makes one violation and hides nothing below it.

use toml::de::DeTable;

use super::Violation;
use crate::text::excerpt::{excerpt, non_ascii_clause_in_toml};

/// Largest number of syntax errors; a file with more is no configuration. Bounds the work, one parse per error.
const MAX_SYNTAX_ERRORS: usize = 20;

/// The text without its broken lines, which become blank so that the others keep their numbers, and a
/// violation for each.
pub(super) fn without_broken_lines(text: &str) -> (String, Vec<Violation>) {
    let mut lines: Vec<&str> = text.lines().collect();
    let mut violations = Vec::new();
    loop {
        let text = lines.join("\n");
        let (_, errors) = DeTable::parse_recoverable(&text);
        let place = |error: &toml::de::Error| error.span().unwrap_or_default().start;
        let Some(error) = errors.iter().min_by_key(|error| place(error)) else {
            return (text, violations);
        };
        let broken = broken_line(&lines, line_at(&text, place(error)) - 1);
        violations.push(Violation {
            line: broken + 1,
            key: "TOML syntax".into(),
            value: lines.get(broken).map(|line| excerpt(line)),
            bound: error.message().to_owned() + &non_ascii_clause_in_toml(lines.get(broken).unwrap_or(&"")),
        });
        if violations.len() == MAX_SYNTAX_ERRORS {
            return (String::new(), violations);
        }
        blank(&mut lines, broken);
    }
}

/// Number of the line that contains byte `offset`, counting from 1.
pub(super) fn line_at(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
}

/// Index of the line that caused an error found in line `found`. An unclosed bracket is found in the next line with
/// content: one that is sound by itself, below lines that are not.
fn broken_line(lines: &[&str], found: usize) -> usize {
    let sound = |text: &str| DeTable::parse(text).is_ok();
    let above = lines.get(..found).unwrap_or(lines);
    if lines.get(found).is_some_and(|line| !sound(line)) || sound(&above.join("\n")) {
        return found;
    }
    above.iter().rposition(|line| !matches!(line.trim().bytes().next(), None | Some(b'#'))).unwrap_or(found)
}

/// Blanks a line. A header takes its section with it, whose keys would otherwise belong to the section above.
fn blank(lines: &mut [&str], broken: usize) {
    let is_header = |line: &str| line.trim_start().starts_with('[');
    let mut rest = lines.iter_mut().skip(broken);
    let Some(first) = rest.next() else { return };
    if is_header(core::mem::take(first)) {
        rest.take_while(|line| !is_header(line)).for_each(|line| *line = "");
    }
}
