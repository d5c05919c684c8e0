//! The machines with their vectors, and how far a reading of the equations is from them.

use super::*;

/// Bound on an error that is rounding only, as a share of the largest force of its row: fifty times what is
/// measured (2e-15), because sine and cosine differ from one mathematics library to another.
pub const ROUNDING: f64 = 1e-13;

/// One row: a state and the forces that belong to it.
pub struct Row {
    pub state: State,
    /// `force_*`
    pub exact: Vector6<f64>,
    /// `force_no_spin_*`
    pub no_spin: Vector6<f64>,
}

pub struct Case {
    pub machine: Machine,
    pub rows: Vec<Row>,
}

pub fn load(name: &str) -> Case {
    let table = Table::read(&data(name, "csv"));
    let row = |row| Row {
        state: State {
            x: table.coordinates(row, ""),
            xd: table.coordinates(row, "_rate"),
            xdd: table.coordinates(row, "_accel"),
        },
        exact: table.legs(row, "force").into(),
        no_spin: table.legs(row, "force_no_spin").into(),
    };
    Case { machine: Machine::load(name), rows: (0..table.rows.len()).map(row).collect() }
}

impl Case {
    /// A reading of the equations against one of the two sets of forces, as a share of the row's largest.
    pub fn error(&self, form: &Form, expected: fn(&Row) -> &Vector6<f64>) -> Errors {
        errors(self.rows.iter().flat_map(|row| {
            let expected = expected(row);
            let error = (forces(&self.machine, &row.state, form) - expected) / expected.amax();
            <[f64; 6]>::from(error)
        }))
    }
}

/// Their statistics.
pub fn errors(values: impl IntoIterator<Item = f64>) -> Errors {
    let mut errors = Errors::default();
    values.into_iter().for_each(|value| errors.add(value));
    errors
}

pub fn exact(row: &Row) -> &Vector6<f64> {
    &row.exact
}

pub fn no_spin(row: &Row) -> &Vector6<f64> {
    &row.no_spin
}
