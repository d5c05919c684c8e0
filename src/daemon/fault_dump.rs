//! Fault dumps: the last cycles before a fault, kept in memory and written to a CSV file when it occurs.
//!
//! A row is the timing of a cycle and the numbers of its messages. The file is made in steps, so that the log thread stays
//! ahead of the loop.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use tracing::{info, warn};

use super::cycle::CycleRecord;
use crate::control::diagnostic::DiagnosticCode;
use crate::control::input_validation::seconds_between;
use crate::control::state::State;
use crate::messages::layout::{Declared, Layout};
use crate::messages::{ForceMessage, MeasuredMessage, SetpointMessage, StatusMessage};
use crate::output::csv_writer::CsvWriter;

/// Cycles kept: two seconds at 1 kHz, 100 ms at 20 kHz. The cause of a fault is rarely older than its timeouts.
const CYCLES_KEPT: usize = 2000;

/// Cycles after the fault that are written too: the response of the daemon.
const CYCLES_AFTER_FAULT: usize = 200;

/// Rows written per step: a fraction of a millisecond.
const ROWS_PER_STEP: usize = 100;

/// Most files of one run: disks are finite.
const MAX_FILES: u32 = 100;

/// Recorder of the cycles around each fault.
pub struct FaultDump {
    folder: Option<PathBuf>,
    home: [f64; 6],
    cycles: VecDeque<CycleRecord>,
    last: DiagnosticCode,
    /// The fault to write, and how many cycles after it are missing.
    due: Option<(CycleRecord, usize)>,
    file: Option<DumpFile>,
    files: u32,
}

/// A file in the making.
struct DumpFile {
    path: PathBuf,
    fault: CycleRecord,
    cycles: VecDeque<CycleRecord>,
    columns: Columns,
    table: CsvWriter,
}

impl FaultDump {
    /// Allocates all memory but that of the files. Without a folder it does nothing.
    pub fn new(folder: Option<&Path>, home: [f64; 6]) -> Self {
        Self {
            folder: folder.map(Path::to_path_buf),
            home,
            cycles: VecDeque::with_capacity(if folder.is_some() { CYCLES_KEPT } else { 0 }),
            last: DiagnosticCode::None,
            due: None,
            file: None,
            files: 0,
        }
    }

    /// Adds a cycle.
    pub fn add(&mut self, record: &CycleRecord) {
        if self.folder.is_none() {
            return;
        }
        if self.cycles.len() == CYCLES_KEPT {
            self.cycles.pop_front();
        }
        self.cycles.push_back(*record);
        let code = record.output.diagnostic.code;
        // A fault is one only if it ends control.
        let ends_control = matches!(record.output.state, State::Stopping | State::Fault);
        if code != self.last && code.is_fault() && ends_control && self.due.is_none() {
            self.due = Some((*record, CYCLES_AFTER_FAULT));
        }
        self.last = code;
        if let Some((fault, missing)) = &mut self.due {
            *missing = missing.saturating_sub(1);
            if *missing == 0 && self.file.is_none() {
                let fault = *fault;
                self.begin(fault);
            }
        }
    }

    fn begin(&mut self, fault: CycleRecord) {
        self.due = None;
        let Some(folder) = self.folder.as_ref().filter(|_| self.files < MAX_FILES) else { return };
        self.files += 1;
        if self.files == MAX_FILES {
            warn!("this was fault number {MAX_FILES}: the cycles of later ones are not written");
        }
        let number = fault.output.diagnostic.code as u32;
        let path = folder.join(format!("fault-{number}-cycle-{}.csv", fault.cycle));
        let columns = Columns::new();
        let table = CsvWriter::new(&columns.names());
        self.file = Some(DumpFile { path, fault, cycles: self.cycles.clone(), columns, table });
    }

    /// Writes some rows.
    pub fn step(&mut self) {
        let Some(DumpFile { path, fault, cycles, columns, table }) = &mut self.file else { return };
        for cycle in cycles.drain(..ROWS_PER_STEP.min(cycles.len())) {
            table.row(columns.row(&cycle, fault, &self.home));
        }
        if cycles.is_empty() {
            match table.save(path) {
                Ok(()) => info!("the cycles around the fault are in {}", path.display()),
                Err(error) => warn!("the cycles around the fault are lost: {error}"),
            }
            self.file = None;
        }
    }

    /// Writes what is due, at the end of the run.
    pub fn finish(&mut self) {
        while self.file.is_some() {
            self.step();
        }
        if let Some((fault, _)) = self.due.take() {
            self.begin(fault);
        }
        while self.file.is_some() {
            self.step();
        }
    }
}

/// Columns about the timing of a cycle; `t` counts from the fault \[s\].
const TIMING: [&str; 6] = ["cycle", "t", "wakeup_ns", "compute_ns", "setpoint_age_s", "measured_age_s"];

/// Columns of a dump: the timing, then the fields of the messages.
struct Columns {
    setpoint: Section,
    measured: Section,
    status: Section,
    force: Section,
}

impl Columns {
    /// Leaves out what is the same in every cycle, not known per cycle, or twice in the messages.
    fn new() -> Self {
        let input = ["header", "reserved", "pose_valid", "x", "twist"];
        Self {
            setpoint: Section::new(&SetpointMessage::LAYOUT, "setpoint_", &["header"]),
            measured: Section::new(&MeasuredMessage::LAYOUT, "measured_", &input),
            status: Section::new(&StatusMessage::LAYOUT, "", &["header", "counters", "io", "statistics"]),
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

    /// One cycle. Inputs that had not arrived are NaN.
    fn row(&self, record: &CycleRecord, fault: &CycleRecord, home: &[f64; 6]) -> Vec<f64> {
        let CycleRecord { cycle, wakeup_ns, compute_ns, input, output, .. } = record;
        let (setpoint, measurement) = (&input.setpoint, &input.measurement);
        let age = |time_ns: Option<u64>| {
            time_ns.map_or(f64::NAN, |time_ns| seconds_between(time_ns, input.release_ns))
        };
        let mut row = vec![
            *cycle as f64,
            seconds_between(fault.input.release_ns, input.release_ns),
            *wakeup_ns as f64,
            *compute_ns as f64,
            age(setpoint.map(|it| it.time_ns)),
            age(measurement.map(|it| it.time_ns)),
        ];
        let setpoint = setpoint.map(|it| SetpointMessage::from(&it).numbers());
        let measured = measurement.map(|it| MeasuredMessage::from(&it).numbers());
        self.setpoint.append(&mut row, setpoint.as_deref());
        self.measured.append(&mut row, measured.as_deref());
        self.status.append(&mut row, Some(&StatusMessage::new(home, output).numbers()));
        self.force.append(&mut row, Some(&ForceMessage::new(output, input.release_ns).numbers()));
        row
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::controller::{Input, Output, Setpoint, SetpointKind};

    fn record(cycle: u64, code: DiagnosticCode) -> CycleRecord {
        CycleRecord {
            cycle,
            input: Input {
                release_ns: cycle * 1_000_000,
                setpoint: Some(Setpoint { kind: SetpointKind::Target, ..Setpoint::default() }),
                ..Input::default()
            },
            output: Output {
                state: State::Stopping,
                diagnostic: code.into(),
                force: [7.5; 6],
                ..Output::default()
            },
            ..CycleRecord::default()
        }
    }

    #[test]
    fn each_fault_has_a_file_with_the_cycles_around_it() {
        let folder = tempfile::tempdir().unwrap();
        let mut dump = FaultDump::new(Some(folder.path()), [0.0; 6]);
        for cycle in 1..=9000 {
            let cause = match cycle {
                3000..3500 => DiagnosticCode::FollowingError,
                8950.. => DiagnosticCode::MeasurementLost,
                _ => DiagnosticCode::None,
            };
            dump.add(&record(cycle, cause));
            dump.step();
        }
        dump.finish();
        for (name, first, last, fault) in
            [("fault-108-cycle-3000.csv", 1200, 3199, 3000), ("fault-101-cycle-8950.csv", 7001, 9000, 8950)]
        {
            let text = std::fs::read_to_string(folder.path().join(name)).unwrap();
            let columns: Vec<_> = text.lines().next().unwrap().split(',').collect();
            let place = |name: &str| columns.iter().position(|column| *column == name).unwrap();
            let [cycle, t, cause, force, kind] =
                ["cycle", "t", "diagnostic_code", "force_n_6", "setpoint_kind"].map(place);
            let rows: Vec<Vec<f64>> = text
                .lines()
                .skip(1)
                .map(|line| line.split(',').map(|value| value.parse().unwrap()).collect())
                .collect();
            assert_eq!((rows[0][cycle], rows[rows.len() - 1][cycle]), (f64::from(first), f64::from(last)));
            for row in rows {
                assert_eq!(row.len(), columns.len());
                assert!((row[t] - (row[cycle] - f64::from(fault)) * 1e-3).abs() < 1e-9);
                assert_eq!((row[force], row[kind]), (7.5, 2.0));
                assert_eq!(
                    row[cause] > 0.0,
                    (row[cycle] as i64 - i64::from(fault)) >= 0 && row[cycle] < 3500.0
                        || row[cycle] >= 8950.0
                );
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn without_a_folder_nothing_is_kept() {
        let mut dump = FaultDump::new(None, [0.0; 6]);
        dump.add(&record(1, DiagnosticCode::FollowingError));
        dump.finish();
        assert_eq!(dump.cycles.capacity(), 0);
    }
}
