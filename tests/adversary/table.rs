//! How near each limit was approached, machine by machine.

use std::fmt::Write;

use super::common::extremes::{Extremes, Quantity};
use super::machines::MACHINES;

/// Largest values of a machine, and how much was tried.
#[derive(Clone, Debug, Default)]
pub struct Row {
    pub machine: usize,
    /// Under control, with each policy.
    pub cycles: [u64; 2],
    pub runs: u64,
    pub end_stops: u64,
    pub extremes: Extremes,
    /// Runs in which a quantity was beyond what is allowed.
    pub violations: [u64; Quantity::ALL.len()],
}

/// A line for each quantity, a column for each machine.
pub fn text(rows: &[Row]) -> String {
    let mut text = format!("{:<24}", "");
    let column = |text: &mut String, content: &str| write!(text, "{content:>14}").unwrap();
    rows.iter().for_each(|row| column(&mut text, MACHINES[row.machine]));
    for (name, value) in [
        ("cycles, policy stop", (|row| row.cycles[0]) as fn(&Row) -> u64),
        ("cycles, policy limit", |row| row.cycles[1]),
        ("runs", |row| row.runs),
        ("end stops", |row| row.end_stops),
    ] {
        write!(text, "\n{name:<24}").unwrap();
        rows.iter().for_each(|row| column(&mut text, &value(row).to_string()));
    }
    for quantity in Quantity::ALL {
        write!(text, "\n{:<24}", quantity.name()).unwrap();
        for row in rows {
            let value = row.extremes.of(quantity);
            let mark = match row.violations[quantity as usize] {
                0 => String::new(),
                count => format!("({count}) "),
            };
            let number = if value == f64::NEG_INFINITY { "-".into() } else { format!("{mark}{value:.3}") };
            column(&mut text, &number);
        }
    }
    text.push('\n');
    text
}
