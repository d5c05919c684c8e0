//! What must hold for every input, whatever it is: for the fuzzer, and for the test that replays its seeds.

#![allow(dead_code, reason = "every target uses a part of it")]

pub mod config;
pub mod csv;
pub mod machine;
pub mod step;

/// Longest line of a message: what is unknown is answered with all that is known.
const MAX_LINE: usize = 1000;

/// The lines of a message, each of bounded length and without what a terminal would obey.
fn lines(message: &str) -> Vec<&str> {
    let lines: Vec<&str> = message.split('\n').collect();
    for line in &lines {
        assert!(line.chars().count() <= MAX_LINE, "long: {line}");
        assert!(!line.chars().any(char::is_control), "control characters: {line:?}");
    }
    lines
}

/// The number of a line in a text of so many.
fn line_number(digits: &str, text: &[u8]) -> usize {
    let number: usize = digits.parse().unwrap_or_else(|_| panic!("{digits:?} is no number of a line"));
    let lines = 1 + text.iter().filter(|byte| **byte == b'\n').count();
    assert!((1..=lines).contains(&number), "line {number} of {lines}");
    number
}
