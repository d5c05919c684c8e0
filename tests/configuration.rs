//! The configuration reader: what loads, what is refused and in which words.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)]

mod bodies;
mod deployment;
mod examination;
mod files;
mod frames;
mod limits;
mod plant;
mod reference;
mod units;
mod values;

use hexad::config::{Config, ConfigError, Violation};

const FRIED: &str = include_str!("../config/fried2008.toml");
const SIX_THREE: &str = include_str!("data/six_three.toml");
const REFERENCE: &str = include_str!("../config/reference.toml");

/// What is wrong with a text; empty if it loads.
fn violations(text: &str) -> Vec<Violation> {
    match Config::parse(text, "test.toml") {
        Ok(_) => Vec::new(),
        Err(ConfigError::Invalid { violations, .. }) => violations,
        Err(other) => panic!("{other}"),
    }
}

/// The machine of the paper with one piece of text replaced.
fn fried_with(from: &str, to: &str) -> String {
    assert_eq!(FRIED.matches(from).count(), 1, "{from:?} must be in the file once");
    FRIED.replace(from, to)
}

/// What is wrong with a text, as it is printed.
fn messages(text: &str) -> Vec<String> {
    violations(text).iter().map(Violation::to_string).collect()
}

/// Asserts that each message is the only one of a file to which its key has been given its value, in the line of the key. Without a
/// value the key is removed, and the line is that of its section.
fn refused_each<T: AsRef<str>>(file: &str, expected: impl IntoIterator<Item = T>) {
    for message in expected {
        let message = message.as_ref().trim();
        let end = message.find(": ").unwrap();
        let (path, value) =
            message[..end].split_once(" = ").map_or((&message[..end], None), |(p, v)| (p, Some(v)));
        let (text, line) = edited(file, path, value);
        let found = violations(&text);
        let [violation] = found.as_slice() else { panic!("{message} must be one violation: {found:#?}") };
        assert_eq!(violation.to_string(), message);
        assert_eq!(violation.line, line, "{message}");
    }
}

/// A file with another value of a key, of an element of its array, or without the key. And the line of it, or of its section.
fn edited(file: &str, path: &str, value: Option<&str>) -> (String, usize) {
    let indexed = |text: &str| match text.strip_suffix(']').and_then(|text| text.split_once('[')) {
        Some((name, index)) => (name.to_owned(), index.parse::<usize>().ok()),
        None => (text.to_owned(), None),
    };
    let (section, key) = path.rsplit_once('.').unwrap_or(("", path));
    let ((name, number), (key, element)) = (indexed(section), indexed(key));
    let header = if number.is_some() { format!("[[{name}]]") } else { format!("[{name}]") };
    let mut lines: Vec<_> = file.lines().map(String::from).collect();
    if !section.is_empty() && !lines.contains(&header) {
        lines.push(header.clone());
    }
    let mut headers = (1..).zip(&lines).filter(|(_, line)| **line == header);
    let begin = headers.nth(number.unwrap_or(1) - 1).map_or(0, |(line, _)| line);
    let of_section = lines[begin..].iter().take_while(|line| !line.starts_with('['));
    let place =
        of_section.clone().position(|line| line.split(" =").next() == Some(&key)).map(|at| begin + at);
    let old = place.map(|at| lines.remove(at));
    let Some(value) = value else { return (lines.join("\n") + "\n", begin.max(1)) };
    let mut value = value.to_owned();
    if let Some(element) = element {
        let old = old.unwrap();
        let mut items: Vec<_> = old[old.find('[').unwrap() + 1..old.find(']').unwrap()].split(", ").collect();
        items[element - 1] = &value;
        value = format!("[{}]", items.join(", "));
    }
    let at = place.unwrap_or(begin);
    lines.insert(at, format!("{key} = {value}"));
    (lines.join("\n") + "\n", at + 1)
}

/// Asserts that an edit of the paper's machine makes exactly this violation, in a line of the edit or, where
/// a section as a whole is wrong or lacks a key, in the line of its header.
fn refused(from: &str, to: &str, message: &str) {
    let text = fried_with(from, to);
    let found = violations(&text);
    let [violation] = found.as_slice() else { panic!("{to:?} must make one violation: {found:#?}") };
    assert_eq!(violation.to_string(), message, "after {to:?}");
    let edited = 1 + FRIED.lines().zip(text.lines()).take_while(|(a, b)| a == b).count();
    let of_section = violation.bound.starts_with("missing") || violation.key == "leg[3]";
    let headers = text.lines().take(edited - 1).enumerate().filter(|(_, line)| line.starts_with('['));
    let header = headers.map(|(i, _)| i + 1).last().unwrap_or(1);
    let lines = if of_section { header..header + 1 } else { edited..edited + to.trim_end().lines().count() };
    assert!(lines.contains(&violation.line), "{violation:?} is not in lines {lines:?}");
}
