//! The table in the documents: written, read back and compared.

use core::cmp::Ordering;
use std::fmt::Write as _;
use std::fs;

use hexad::control::signals::diagnostic::DiagnosticCode;

use super::{Cell, Situation};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/hardware_failures.md");
/// Other processors round otherwise: allowed differences of times and distances, relative and absolute.
const RELATIVE: f64 = 0.25;
const TIME_S: f64 = 0.01;
const DISTANCE_M: f64 = 2e-5;

impl Cell {
    fn text(&self) -> String {
        let farthest = format!("{:.3} mm", 1e3 * self.farthest);
        match self.noticed {
            Some((code, time_s)) => format!("{}: {:.0} ms, {farthest}", code as u32, 1e3 * time_s),
            None => format!("{NOT_NOTICED}, {farthest}"),
        }
    }

    /// Order by danger: not noticed is worst, then the farthest.
    pub fn order(&self, other: &Self) -> Ordering {
        let key = |cell: &Self| (cell.noticed.is_none(), cell.farthest);
        let ((a, a_m), (b, b_m)) = (key(self), key(other));
        a.cmp(&b).then(a_m.total_cmp(&b_m))
    }

    /// Whether it is that of a text.
    pub fn is_as(&self, text: &str) -> bool {
        let Some((noticed, farthest)) = parsed(text) else { return false };
        let is_near =
            |a: f64, b: f64, absolute: f64| (a - b).abs() <= absolute + RELATIVE * a.abs().max(b.abs());
        let is_noticed = match self.noticed {
            None => noticed == NOT_NOTICED,
            Some((code, time_s)) => noticed
                .strip_prefix(&format!("{}:", code as u32))
                .is_some_and(|rest| number(rest, "ms").is_some_and(|ms| is_near(1e-3 * ms, time_s, TIME_S))),
        };
        is_near(farthest, self.farthest, DISTANCE_M) && is_noticed
    }

    /// Whether it is noticed if that of a text is, and moves no farther.
    pub fn is_no_worse(&self, text: &str) -> bool {
        parsed(text).is_some_and(|(noticed, farthest)| {
            let is_noticed = self.noticed.is_some() || noticed == NOT_NOTICED;
            is_noticed && self.farthest <= (1.0 + RELATIVE) * farthest + FARTHER_M
        })
    }
}

const NOT_NOTICED: &str = "not detected";
/// With rates a length that counts backwards is noticed as rates that differ, which takes 15 ms longer.
const FARTHER_M: f64 = 7e-4;

/// What was noticed, and the distance \[m\].
fn parsed(text: &str) -> Option<(&str, f64)> {
    let (noticed, farthest) = text.rsplit_once(", ")?;
    Some((noticed, 1e-3 * number(farthest, "mm")?))
}

fn number(text: &str, unit: &str) -> Option<f64> {
    text.strip_suffix(unit)?.trim().rsplit(' ').next()?.parse().ok()
}

/// A failure, and what became of it in each situation.
pub type Row<'a> = (&'a str, [Cell; Situation::ALL.len()]);

/// The document before a table, the table, and what follows. Its first line begins with the head of its first column.
fn parts<'a>(document: &'a str, head: &str) -> [&'a str; 3] {
    let (before, rest) = document.split_at(document.find(&format!("| {head} |")).unwrap());
    let (table, after) = rest.split_at(rest.find("\n\n").map_or(rest.len(), |end| end + 1));
    [before, table, after]
}

/// Writes a table into the documents.
pub fn write(head: &str, rows: &[Row]) {
    let document = fs::read_to_string(FILE).unwrap();
    let [before, _, after] = parts(&document, head);
    let mut text =
        format!("{before}| {head} | at rest | slow | fast | engaging |\n| --- | --- | --- | --- | --- |\n");
    for (name, cells) in rows {
        let cells: Vec<String> = cells.iter().map(Cell::text).collect();
        writeln!(text, "| {name} | {} |", cells.join(" | ")).unwrap();
    }
    fs::write(FILE, text + after).unwrap();
}

/// Compares these rows with the table of the documents, which has all.
pub fn check<'a>(
    head: &str,
    all: impl Iterator<Item = &'a str>,
    rows: &[Row],
    is_right: fn(&Cell, &str) -> bool,
) {
    let document = fs::read_to_string(FILE).unwrap();
    let [_, table, _] = parts(&document, head);
    let lines = table.lines().skip(2).map(|line| line.trim_matches('|').split('|').map(str::trim));
    let lines: Vec<Vec<&str>> = lines.map(Iterator::collect).collect();
    assert!(lines.iter().map(|texts| texts[0]).eq(all), "{FILE}: rows");
    let mut wrong = String::new();
    let numbers = lines.iter().flat_map(|texts| &texts[1..]);
    let numbers = numbers.filter_map(|text| text.split_once(':')?.0.parse::<u32>().ok());
    for code in numbers.filter_map(DiagnosticCode::from_number) {
        let legend = format!("| {} | {} |", code as u32, code.name());
        assert!(document.contains(&legend), "{FILE}: no row {legend}");
    }
    for (name, cells) in rows {
        let texts = lines.iter().find(|texts| texts[0] == *name).unwrap();
        for (text, (cell, situation)) in texts[1..].iter().zip(cells.iter().zip(Situation::ALL)) {
            if !is_right(cell, text) {
                writeln!(wrong, "{name}, {situation:?}: {}; in the table: {text}", cell.text()).unwrap();
            }
        }
    }
    assert!(wrong.is_empty(), "{FILE}:\n{wrong}");
}
