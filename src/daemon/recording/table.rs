//! Recordings as CSV: a row is the timing of a cycle, the motions that it knows, and the other numbers of its messages.

use std::path::Path;

use super::reader::{Recording, Summary};
use super::table_choice::TableChoice;
use super::{Item, RecordingError};
use hexad_client::messages::layout::{Declared, Layout};
use hexad_client::messages::{CycleMessage, ForceMessage, MeasuredMessage, SetpointMessage, StatusMessage};
use hexad_core::control::controller::Output;
use hexad_core::control::signals::inputs::{Input, SetpointKind};
use hexad_core::control::signals::time::seconds_between;
use hexad_core::model::task::{TaskState, task_coordinates};
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::csv_table::{in_group, pose_columns, trajectory_columns};
use hexad_machine::text::csv_writer::CsvWriter;
use hexad_machine::text::numbers::AXES;
use hexad_machine::text::units::MotionUnits;

/// Instants and origin of the numbers of a table.
pub struct TableOrigin {
    /// Origin of the angles of X.
    pub home: [f64; 6],
    /// Release of a cycle to the instant of its reference \[ns\].
    pub reference_ns: u64,
    /// Coordinates of the groups [`TOOL_POSES`], and their units if they are not in SI; without it there are no such groups.
    pub tool: Option<(Coordinates, Option<MotionUnits>)>,
}

/// Writes the chosen columns and cycles of a recording as CSV; without a choice all but columns that have no number in any cycle.
/// `t` counts from the fault whose window it is, else from the first cycle. Returns the number of rows, too.
pub fn write_csv(
    recording: &Recording,
    origin: &TableOrigin,
    choice: &TableChoice,
    path: &Path,
) -> Result<(Summary, u64), RecordingError> {
    let Summary { fault, first, .. } = recording.summary()?;
    let mut zero_ns = first.release_ns;
    let columns = Columns::new();
    let names = columns.names(origin);
    let mut has_number = vec![false; names.len()];
    recording.each(|item| {
        let Item::Cycle(cycle) = item else { return };
        if Some(cycle.cycle) == fault {
            zero_ns = cycle.release_ns;
        }
        let row = columns.row(&cycle, zero_ns, origin).unwrap_or_default();
        has_number.iter_mut().zip(row).for_each(|(has_number, number)| *has_number |= !number.is_nan());
    })?;
    fn kept<T>(all: Vec<T>, is_kept: &[bool]) -> impl Iterator<Item = T> {
        all.into_iter().zip(is_kept).filter(|(_, is_kept)| **is_kept).map(|(kept, _)| kept)
    }
    let names = [names, NAMES.map(String::from).into()].concat();
    has_number.extend(NAMES.map(|_| true));
    let is_kept = choice.kept(&names, &has_number)?;
    let mut table = CsvWriter::new(&kept(names, &is_kept).collect::<Vec<_>>());
    let (are_numbers_kept, are_names_kept) = is_kept.split_at(is_kept.len() - NAMES.len());
    let (mut rows, mut last) = (0, None);
    let summary = recording.each(|item| {
        let Item::Cycle(cycle) = item else { return };
        let interval = Some(choice.every.interval(&first, &cycle));
        if interval != last
            && let Some(row) = columns.row(&cycle, zero_ns, origin)
        {
            table.row_with_names(kept(row, are_numbers_kept), kept(names_of(&cycle).into(), are_names_kept));
            (rows, last) = (rows + 1, interval);
        }
    })?;
    table.save(path)?;
    Ok((summary, rows))
}

/// Columns about the timing of a cycle; `t` \[s\].
const TIMING: [&str; 4] = ["cycle", "t", "wakeup_ns", "compute_ns"];

/// Columns of names, the last.
const NAMES: [&str; 2] = ["state", "setpoint_kind"];

/// Groups of X, X', X'': what a source requires for an instant, and what the controller follows.
const MOTIONS: [&str; 2] = ["setpoint", "reference"];

/// Groups of X: to move to, found from the lengths, by another sensor.
const POSES: [&str; 3] = ["target", "estimated", "measured"];

/// Groups of X of a tool in a work frame: of the reference, and found from the lengths.
pub const TOOL_POSES: [&str; 2] = ["tool_reference", "tool_estimated"];

/// Fields of the measured message that are in no cycle or in a group.
const NOT_MEASURED: [&str; 5] = ["header", "reserved", "pose_valid", "x", "twist"];

/// Fields of the status that are in no cycle or in a group.
const NOT_IN_STATUS: [&str; 8] =
    ["header", "counters", "io", "in_position", "limits_scale", "state", "pose_valid", "x"];

/// Fields of the force message that are constant or in the status.
const NOT_IN_FORCE: [&str; 6] =
    ["header", "state", "diagnostic_code", "active_limits", "checksum", "reserved"];

/// Columns of numbers: the timing, the groups, then the other fields of the messages.
struct Columns {
    setpoint: Section,
    measured: Section,
    status: Section,
    force: Section,
}

impl Columns {
    fn new() -> Self {
        let in_group = ["header", "kind", "x"];
        Self {
            setpoint: Section::new(&SetpointMessage::LAYOUT, "setpoint_", &in_group),
            measured: Section::new(&MeasuredMessage::LAYOUT, "measured_", &NOT_MEASURED),
            status: Section::new(&StatusMessage::LAYOUT, "", &NOT_IN_STATUS),
            force: Section::new(&ForceMessage::LAYOUT, "", &NOT_IN_FORCE),
        }
    }

    fn names(&self, origin: &TableOrigin) -> Vec<String> {
        let mut names: Vec<_> = TIMING.map(String::from).into();
        names.extend(MOTIONS.iter().flat_map(|group| in_group(group, &trajectory_columns())));
        names.extend(POSES.iter().flat_map(|group| in_group(group, &pose_columns())));
        for section in [&self.setpoint, &self.measured, &self.status, &self.force] {
            names.extend_from_slice(&section.names);
        }
        if let Some((_, units)) = &origin.tool {
            let unit = |axis| units.map_or_else(String::new, |units| format!("_{}", units.of_axis(axis).0));
            let coordinates = AXES.iter().enumerate().map(|(axis, name)| format!("{name}{}", unit(axis)));
            let columns: Vec<_> = ["t".into()].into_iter().chain(coordinates).collect();
            names.extend(TOOL_POSES.iter().flat_map(|group| in_group(group, &columns)));
        }
        names
    }

    /// Numbers of a cycle; `None` if one of them has no meaning. Absent numbers are NaN.
    fn row(&self, cycle: &CycleMessage, zero_ns: u64, origin: &TableOrigin) -> Option<Vec<f64>> {
        let (input, output) = (cycle.input()?, cycle.output()?);
        let t = seconds_between(zero_ns, input.release_ns);
        let mut row = vec![cycle.cycle as f64, t, cycle.wakeup_ns as f64, cycle.compute_ns as f64];
        append_groups(&mut row, &input, &output, zero_ns, origin);
        let setpoint = input.setpoint.map(|it| SetpointMessage::from(&it).numbers());
        let measured = input.measurement.map(|it| {
            let mut message = MeasuredMessage::from(&it);
            // Zeros in the message.
            message.length_rate_m_s = it.rate_m_s.unwrap_or([f64::NAN; 6]);
            message.force_n = it.drives.force_n.unwrap_or([f64::NAN; 6]);
            message.numbers()
        });
        let status = StatusMessage::new(&origin.home, &output, input.setpoint.as_ref());
        self.setpoint.append(&mut row, setpoint.as_deref());
        self.measured.append(&mut row, measured.as_deref());
        self.status.append(&mut row, Some(&status.numbers()));
        self.force.append(&mut row, Some(&ForceMessage::new(&output, input.release_ns).numbers()));
        if let Some((coordinates, units)) = &origin.tool {
            let end_ns = input.release_ns + origin.reference_ns;
            let reference = reference(&output, &origin.home).map(|it| (end_ns, it.x.into()));
            for pose in [reference, estimated(&input, &output, &origin.home)] {
                row.push(pose.map_or(f64::NAN, |(instant_ns, _)| seconds_between(zero_ns, instant_ns)));
                let x = pose.map_or([f64::NAN; 6], |(_, x)| coordinates.tool_x(&x));
                let factor = |axis| units.map_or(1.0, |units| units.of_axis(axis).1);
                row.extend(x.into_iter().enumerate().map(|(axis, x)| x / factor(axis)));
            }
        }
        Some(row)
    }
}

/// State and kind of the setpoint.
fn names_of(cycle: &CycleMessage) -> [&'static str; 2] {
    let output = cycle.output().unwrap_or_default();
    [output.state.name(), cycle.input().and_then(|input| input.setpoint).map_or("", |it| it.kind.name())]
}

/// The reference at the end of the hold of the cycle's force.
fn reference(output: &Output, home: &[f64; 6]) -> Option<TaskState> {
    output.reference.and_then(|it| TaskState::of_motion(&it, home))
}

/// X from the measured lengths, and its instant \[ns\].
fn estimated(input: &Input, output: &Output, home: &[f64; 6]) -> Option<(u64, [f64; 6])> {
    let (measured, platform) = input.measurement.zip(output.platform)?;
    Some((measured.time_ns, task_coordinates(&platform.pose, home)))
}

/// Adds the groups of a cycle, each with the instant of its motion or pose.
fn append_groups(row: &mut Vec<f64>, input: &Input, output: &Output, zero_ns: u64, origin: &TableOrigin) {
    let t = |instant_ns: u64| seconds_between(zero_ns, instant_ns);
    let home = &origin.home;
    let mut append = |numbers: Option<Vec<f64>>, width: usize| {
        let numbers = numbers.unwrap_or_default();
        row.extend(numbers.into_iter().chain(core::iter::repeat(f64::NAN)).take(width));
    };
    let pose = |t: f64, x: &[f64; 6]| [&[t], x.as_slice()].concat();
    let motion = |t: f64, task: &TaskState| {
        [&[t], task.x.as_slice(), task.xd.as_slice(), task.xdd.as_slice()].concat()
    };
    let of_kind = |kind: SetpointKind| input.setpoint.filter(|it| it.kind == kind);
    let requested = of_kind(SetpointKind::Motion).map(|it| motion(t(it.time_ns), &it.task));
    // The derivatives of a pose are zeros in the message.
    let sampled = of_kind(SetpointKind::Pose).map(|it| pose(t(it.time_ns), &it.task.x.into()));
    append(requested.or(sampled), trajectory_columns().len());
    let end = t(input.release_ns + origin.reference_ns);
    append(reference(output, home).map(|it| motion(end, &it)), trajectory_columns().len());
    let target = of_kind(SetpointKind::Target).map(|it| pose(t(it.time_ns), &it.task.x.into()));
    append(target, pose_columns().len());
    append(estimated(input, output, home).map(|(ns, x)| pose(t(ns), &x)), pose_columns().len());
    let measured = input.measurement.map(|it| (t(it.time_ns), it.pose));
    // The lengths have the same instant.
    append(measured.map(|(t, x)| pose(t, &x.unwrap_or([f64::NAN; 6]))), pose_columns().len());
}

/// Columns from one message.
struct Section {
    names: Vec<String>,
    /// Which numbers of the message they are.
    places: Vec<usize>,
}

impl Section {
    /// Columns of all fields but the excluded ones. Lengths and forces have the names of the other tables: without unit, in SI. A
    /// force that is sent is the command of the drive, one that is measured the force of the leg.
    fn new(layout: &Layout, prefix: &str, excluded: &[&str]) -> Self {
        let is_of = |name: &str, field: &str| {
            name.strip_prefix(field).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
        };
        let force = if prefix.is_empty() { "drive_command_" } else { "force_" };
        let without_unit = |name: String| {
            [("length_m_", "length_"), ("length_rate_m_s_", "length_rate_"), ("force_n_", force)]
                .iter()
                .find_map(|(from, to)| Some(format!("{to}{}", name.strip_prefix(from)?)))
                .unwrap_or(name)
        };
        let columns = layout.columns("").into_iter().enumerate();
        let kept = columns.filter(|(_, name)| !excluded.iter().any(|field| is_of(name, field)));
        let (places, names) =
            kept.map(|(place, name)| (place, format!("{prefix}{}", without_unit(name)))).unzip();
        Self { names, places }
    }

    fn append(&self, row: &mut Vec<f64>, numbers: Option<&[f64]>) {
        let number = |place: &usize| numbers.and_then(|numbers| numbers.get(*place).copied());
        row.extend(self.places.iter().map(|place| number(place).unwrap_or(f64::NAN)));
    }
}
