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
