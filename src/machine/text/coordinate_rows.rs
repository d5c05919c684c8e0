//! X as a table, in units that a person chooses.

use super::numbers::{AXES, fixed, last_digits};
use super::units::MotionUnits;

/// Least width of a column: coordinates of a few metres in millimetres and degrees.
const MIN_WIDTH: usize = 11;

/// X of a row with its name, and how many digits more it has than the others. `None` if X is unknown.
pub type Row<'a> = (&'a str, Option<[f64; 6]>, i32);

/// Coordinates of X as people read them: in these units, with the digits that show a resolution.
#[derive(Clone, Debug)]
pub struct CoordinateFormat(Vec<Column>);

#[derive(Clone, Debug)]
struct Column {
    /// Name with its unit.
    name: String,
    /// Factor from the unit to SI.
    factor: f64,
    /// Power of ten of the last digit.
    power: i32,
}

impl CoordinateFormat {
    /// Format for a resolution \[m\], \[rad\].
    pub fn new(units: MotionUnits, resolution: [f64; 2]) -> Self {
        let column = |(axis, (name, power)): (usize, (&str, i32))| {
            let (unit, factor) = units.of_axis(axis);
            Column { name: format!("{name} {unit}"), factor, power }
        };
        Self(AXES.into_iter().zip(last_digits(resolution, units)).enumerate().map(column).collect())
    }

    /// Names of X with their units.
    pub fn names(&self) -> impl Iterator<Item = String> {
        self.0.iter().map(|column| column.name.clone())
    }

    /// Numbers of X, with so many digits more.
    pub fn numbers(&self, x: &[f64; 6], more: i32) -> impl Iterator<Item = String> {
        self.0.iter().zip(x).map(move |(Column { factor, power, .. }, x)| {
            fixed(x / factor, usize::try_from(more - power).unwrap_or_default())
        })
    }

    /// Table with rows of X below their names, and above these a label of what has these coordinates, unless it is empty.
    pub fn table(&self, label: &str, rows: &[Row<'_>]) -> String {
        let cells = |&(_, x, more): &Row<'_>| match x {
            Some(x) => self.numbers(&x, more).collect::<Vec<_>>(),
            None => vec!["unknown".into()],
        };
        let named: Vec<_> = [("", self.names().collect::<Vec<_>>())]
            .into_iter()
            .chain(rows.iter().map(|row| (row.0, cells(row))))
            .collect();
        let longest = named.iter().flat_map(|(_, cells)| cells).map(|cell| cell.len() + 1).max();
        let width = MIN_WIDTH.max(longest.unwrap_or_default());
        let line = |(name, cells): &(&str, Vec<String>)| {
            let cells: String = cells.iter().map(|cell| format!("{cell:>width$}")).collect();
            format!("{name:10}{cells}\n")
        };
        let label = if label.is_empty() { String::new() } else { format!("{label}\n") };
        label + &named.iter().map(line).collect::<String>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_units_digits_and_a_space_between_them() {
        let x = [-0.5, 1.5e-5, 0.0, -1.234_567_891, 25e-9, 0.65];
        let shown = |units: &str, resolution: [f64; 2]| {
            let format = CoordinateFormat::new(MotionUnits::read(units).unwrap(), resolution);
            format.table("a label", &[("pose", Some(x), 0), ("error", None, 1)])
        };
        let fine = shown("nm,arcsec", [1e-9, 2e-8]);
        let wanted = "a label\n           alpha arcsec  beta arcsec gamma arcsec         x nm         y nm         z nm\n\
                      pose        -103132.403        3.094        0.000  -1234567891           25    650000000\n\
                      error           unknown\n";
        assert_eq!(fine, wanted);
        // Of a coarse machine: micrometres, and arcseconds of a thousandth of a degree.
        let coarse = shown("um,arcsec", [1e-4, 1e-3]);
        assert!(coarse.contains(" -103132 ") && coarse.contains(" -1234568 "), "{coarse}");
        let usual = "            alpha deg   beta deg  gamma deg       x mm       y mm       z mm\n\
                     pose          -28.648      0.001      0.000  -1234.568      0.000    650.000\n\
                     error         unknown\n";
        assert_eq!(shown("mm,deg", [1e-4, 1e-3]), format!("a label\n{usual}"));
    }
}
