//! Recordings as CSV: a row is the timing of a cycle and the numbers of its messages.

use std::path::Path;

use super::reader::{Recording, Summary};
use super::{Item, RecordingError};
use crate::control::signals::time::seconds_between;
use crate::messages::layout::{Declared, Layout};
use crate::messages::{CycleMessage, ForceMessage, MeasuredMessage, SetpointMessage, StatusMessage};
use crate::output::csv_writer::CsvWriter;

/// Writes the cycles of a recording as CSV. `home` is the origin of the angles of X. `t` counts from the fault whose window it
/// is, else from the first cycle.
pub fn write_csv(recording: &Recording, home: &[f64; 6], path: &Path) -> Result<Summary, RecordingError> {
    let Summary { fault, first, .. } = recording.summary()?;
    let mut zero_ns = first.release_ns;
    recording.each(|item| match item {
        Item::Cycle(cycle) if Some(cycle.cycle) == fault => zero_ns = cycle.release_ns,
        _ => {}
    })?;
    let columns = Columns::new();
    let mut table = CsvWriter::new(&columns.names());
    let summary = recording.each(|item| {
        if let Item::Cycle(cycle) = item {
            columns.row(&cycle, zero_ns, home).into_iter().for_each(|row| table.row(row));
        }
    })?;
    table.save(path)?;
    Ok(summary)
}

/// Columns about the timing of a cycle; `t` \[s\].
const TIMING: [&str; 6] = ["cycle", "t", "wakeup_ns", "compute_ns", "setpoint_age_s", "measured_age_s"];

/// Fields of the status that a recorded cycle does not have.
const NOT_PER_CYCLE: [&str; 5] = ["header", "counters", "io", "in_position", "limits_scale"];

/// Columns of the table: the timing, then the fields of the messages.
struct Columns {
    setpoint: Section,
    measured: Section,
    status: Section,
    force: Section,
}

impl Columns {
    /// Leaves out fields that are constant, not available per cycle, or contained twice in the messages.
    fn new() -> Self {
        let input = ["header", "reserved", "pose_valid", "x", "twist"];
        Self {
            setpoint: Section::new(&SetpointMessage::LAYOUT, "setpoint_", &["header"]),
            measured: Section::new(&MeasuredMessage::LAYOUT, "measured_", &input),
            status: Section::new(&StatusMessage::LAYOUT, "", &NOT_PER_CYCLE),
            force: Section::new(
                &ForceMessage::LAYOUT,
                "",
                &["header", "state", "diagnostic_code", "active_limits", "checksum", "reserved"],
            ),
        }
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<_> = TIMING.map(String::from).into();
        for section in [&self.setpoint, &self.measured, &self.status, &self.force] {
            names.extend_from_slice(&section.names);
        }
        names
    }

    /// One cycle; `None` if one of its numbers has no meaning. Inputs that had not arrived are NaN.
    fn row(&self, cycle: &CycleMessage, zero_ns: u64, home: &[f64; 6]) -> Option<Vec<f64>> {
        let (input, output) = (cycle.input()?, cycle.output()?);
        let age = |time_ns: Option<u64>| {
            time_ns.map_or(f64::NAN, |time_ns| seconds_between(time_ns, input.release_ns))
        };
        let mut row = vec![
            cycle.cycle as f64,
            seconds_between(zero_ns, input.release_ns),
            cycle.wakeup_ns as f64,
            cycle.compute_ns as f64,
            age(input.setpoint.map(|it| it.time_ns)),
            age(input.measurement.map(|it| it.time_ns)),
        ];
        let setpoint = input.setpoint.map(|it| SetpointMessage::from(&it).numbers());
        let measured = input.measurement.map(|it| MeasuredMessage::from(&it).numbers());
        self.setpoint.append(&mut row, setpoint.as_deref());
        self.measured.append(&mut row, measured.as_deref());
        self.status
            .append(&mut row, Some(&StatusMessage::new(home, &output, input.setpoint.as_ref()).numbers()));
        self.force.append(&mut row, Some(&ForceMessage::new(&output, input.release_ns).numbers()));
        Some(row)
    }
}

/// Columns from one message.
struct Section {
    names: Vec<String>,
    /// Which numbers of the message they are.
    places: Vec<usize>,
}

impl Section {
    fn new(layout: &Layout, prefix: &str, excluded: &[&str]) -> Self {
        let is_of = |name: &str, field: &str| {
            name.strip_prefix(field).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
        };
        let columns = layout.columns("").into_iter().enumerate();
        let kept = columns.filter(|(_, name)| !excluded.iter().any(|field| is_of(name, field)));
        let (places, names) = kept.map(|(place, name)| (place, format!("{prefix}{name}"))).unzip();
        Self { names, places }
    }

    fn append(&self, row: &mut Vec<f64>, numbers: Option<&[f64]>) {
        let number = |place: &usize| numbers.and_then(|numbers| numbers.get(*place).copied());
        row.extend(self.places.iter().map(|place| number(place).unwrap_or(f64::NAN)));
    }
}
