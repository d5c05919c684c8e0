//! X as a line of a table, in millimetres and degrees.

use super::numbers::{AXES, MotionDigits, axis_unit, fixed};

/// Line with X in millimetres and degrees.
pub fn row(name: &str, x: &[f64; 6], digits: MotionDigits) -> String {
    let numbers: String = x
        .iter()
        .enumerate()
        .map(|(k, x)| format!("{:>11}", fixed(x * axis_unit(k).0, digits.of_axis(k))))
        .collect();
    format!("{name:10}{numbers}\n")
}

/// Heading with the names of X, above [`row`], and above it what has these coordinates, unless the label is empty.
pub fn heading(label: &str) -> String {
    let names: String = AXES
        .iter()
        .enumerate()
        .map(|(k, axis)| format!("{:>11}", format!("{axis} {}", axis_unit(k).1)))
        .collect();
    let label = if label.is_empty() { String::new() } else { format!("{label}\n") };
    format!("{label}{:10}{names}\n", "")
}
