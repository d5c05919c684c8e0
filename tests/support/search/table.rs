//! How near each limit was approached, machine by machine.

use std::fmt::Write;

use super::genome::{Sensors, World};
use super::machines::MACHINES;
use super::property::PROPERTIES;

/// Largest values of a machine, and how much was tried.
#[derive(Clone, Debug)]
pub struct Row {
    pub machine: usize,
    /// Under control, with each policy.
    pub cycles: [u64; 2],
    pub runs: u64,
    pub end_stops: u64,
    /// Runs in which a property was judged, by world and sensors.
    pub judged: [[[u64; PROPERTIES.len()]; Sensors::ALL.len()]; World::ALL.len()],
    /// Largest value of each property.
    pub worst: [f64; PROPERTIES.len()],
    /// Runs in which a property did not hold.
    pub violations: [u64; PROPERTIES.len()],
}

impl Row {
    pub fn new(machine: usize) -> Self {
        Self {
            machine,
            cycles: [0; 2],
            runs: 0,
            end_stops: 0,
            judged: [[[0; PROPERTIES.len()]; Sensors::ALL.len()]; World::ALL.len()],
            worst: [f64::NEG_INFINITY; PROPERTIES.len()],
            violations: [0; PROPERTIES.len()],
        }
    }
}

/// A line for each property, a column for each machine.
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
    for (index, property) in PROPERTIES.iter().enumerate() {
        write!(text, "\n{:<24}", property.name).unwrap();
        for row in rows {
            let value = row.worst[index];
            let mark = match row.violations[index] {
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
