//! The last cycles before a fault, kept in memory and written to a file when one comes.
//!
//! The file is made in steps, so that the log thread stays ahead of the loop.

use super::cycle::CycleRecord;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use tracing::{info, warn};

use crate::control::controller::Output;
use crate::control::diagnostic::DiagnosticCode;
use crate::control::state::State;
use crate::model::task::task_coordinates;
use crate::output::csv_table::{coordinates, legs};
use crate::output::csv_writer::CsvWriter;

/// Cycles kept: two seconds at 1 kHz, 100 ms at 20 kHz. The cause of a fault is rarely older than its timeouts.
const KEPT: usize = 2000;

/// Cycles after the fault that are written too: what the daemon did about it.
const AFTER: usize = 200;

/// Rows written per step: a fraction of a millisecond.
const ROWS: usize = 100;

/// Files of one run. A machine that faults more often has told enough, and disks are finite.
const MOST_FILES: u32 = 100;

/// Keeps cycles and writes them.
pub struct FaultDump {
    folder: Option<PathBuf>,
    home: [f64; 6],
    cycles: VecDeque<CycleRecord>,
    last: DiagnosticCode,
    /// The fault to write, and how many cycles after it are missing.
    due: Option<(CycleRecord, usize)>,
    writing: Option<Writing>,
    files: u32,
}

struct Writing {
    path: PathBuf,
    fault: CycleRecord,
    cycles: VecDeque<CycleRecord>,
    table: CsvWriter,
}

impl FaultDump {
    /// Allocates what it will ever need but for the files. Without a folder it does nothing.
    pub fn new(folder: Option<&Path>, home: [f64; 6]) -> Self {
        Self {
            folder: folder.map(Path::to_path_buf),
            home,
            cycles: VecDeque::with_capacity(if folder.is_some() { KEPT } else { 0 }),
            last: DiagnosticCode::None,
            due: None,
            writing: None,
            files: 0,
        }
    }

    /// Takes a cycle in.
    pub fn add(&mut self, record: &CycleRecord) {
        if self.folder.is_none() {
            return;
        }
        if self.cycles.len() == KEPT {
            self.cycles.pop_front();
        }
        self.cycles.push_back(*record);
        let cause = record.output.diagnostic.code;
        // Without force there is no fault, only something missing.
        let takes_force_away = matches!(record.output.state, State::Stopping | State::Fault);
        if cause != self.last && cause.is_fault() && takes_force_away && self.due.is_none() {
            self.due = Some((*record, AFTER));
        }
        self.last = cause;
        if let Some((fault, missing)) = &mut self.due {
            *missing = missing.saturating_sub(1);
            if *missing == 0 && self.writing.is_none() {
                let fault = *fault;
                self.begin(fault);
            }
        }
    }

    fn begin(&mut self, fault: CycleRecord) {
        self.due = None;
        let Some(folder) = self.folder.as_ref().filter(|_| self.files < MOST_FILES) else { return };
        self.files += 1;
        if self.files == MOST_FILES {
            warn!("this was fault number {MOST_FILES}: the cycles of later ones are not written");
        }
        let number = fault.output.diagnostic.code as u32;
        let path = folder.join(format!("fault-{number}-cycle-{}.csv", fault.cycle));
        let table = CsvWriter::new(&columns());
        self.writing = Some(Writing { path, fault, cycles: self.cycles.clone(), table });
    }

    /// Writes some rows.
    pub fn step(&mut self) {
        let Some(writing) = &mut self.writing else { return };
        let Writing { path, fault, cycles, table } = writing;
        for cycle in cycles.drain(..ROWS.min(cycles.len())) {
            table.row(row(&cycle, fault, &self.home));
        }
        if cycles.is_empty() {
            match table.save(path) {
                Ok(()) => info!("the cycles around the fault are in {}", path.display()),
                Err(error) => warn!("the cycles around the fault are lost: {error}"),
            }
            self.writing = None;
        }
    }

    /// Writes what is due, at the end of the run.
    pub fn finish(&mut self) {
        while self.writing.is_some() {
            self.step();
        }
        if let Some((fault, _)) = self.due.take() {
            self.begin(fault);
        }
        while self.writing.is_some() {
            self.step();
        }
    }
}

fn columns() -> Vec<String> {
    let named = |prefix: &str, suffix: &str| -> Vec<String> {
        coordinates(suffix).into_iter().map(|name| format!("{prefix}_{name}")).collect()
    };
    let words = |words: &[&str]| words.iter().map(|word| (*word).into()).collect::<Vec<String>>();
    [
        words(&["cycle", "t", "state", "fault", "fault_value", "fault_bound", "fault_index", "limiting"]),
        words(&["wakeup_ns", "compute_ns", "setpoint_age", "measured_age"]),
        named("setpoint", ""),
        named("setpoint", "_rate"),
        named("setpoint", "_accel"),
        legs("length"),
        legs("length_rate"),
        named("measured", ""),
        words(&["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"]),
        words(&["error_rotation_x", "error_rotation_y", "error_rotation_z", "error_x", "error_y", "error_z"]),
        legs("force"),
        words(&[
            "more_torque_x",
            "more_torque_y",
            "more_torque_z",
            "more_force_x",
            "more_force_y",
            "more_force_z",
        ]),
    ]
    .concat()
}

/// One cycle; `t` counts from the fault. What was not there is NaN.
fn row(record: &CycleRecord, fault: &CycleRecord, home: &[f64; 6]) -> Vec<f64> {
    let CycleRecord { cycle, wakeup_ns, compute_ns, input, output, .. } = record;
    let Output { state, diagnostic, force, wrench_error, active_limits, platform, error, .. } = output;
    let since = |from_ns: u64, to_ns: u64| to_ns.wrapping_sub(from_ns) as i64 as f64 * 1e-9;
    let age = |time_ns: Option<u64>| time_ns.map_or(f64::NAN, |time_ns| since(time_ns, input.release_ns));
    let absent = [f64::NAN; 6];
    let (setpoint, measurement) = (&input.setpoint, &input.measurement);
    let task = setpoint.map_or([absent; 3], |it| [it.task.x.into(), it.task.xd.into(), it.task.xdd.into()]);
    let legs = measurement.map_or([absent; 2], |it| [it.length, it.rate]);
    let (pose, twist) = platform.map_or((absent, absent), |platform| {
        (task_coordinates(&platform.pose, home), platform.twist.vector().into())
    });
    let wrench_error = wrench_error.vector().into();
    let error = error.map_or(absent, |error| error.pose.vector().into());
    let mut row = vec![
        *cycle as f64,
        since(fault.input.release_ns, input.release_ns),
        f64::from(*state as u32),
        f64::from(diagnostic.code as u32),
        diagnostic.value,
        diagnostic.bound,
        f64::from(diagnostic.index),
        f64::from(active_limits.0),
        *wakeup_ns as f64,
        *compute_ns as f64,
        age(setpoint.map(|it| it.time_ns)),
        age(measurement.map(|it| it.time_ns)),
    ];
    for six in task.iter().chain(&legs).chain([&pose, &twist, &error, force, &wrench_error]) {
        row.extend(six);
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::controller::Input;

    fn record(cycle: u64, cause: DiagnosticCode) -> CycleRecord {
        CycleRecord {
            cycle,
            input: Input { release_ns: cycle * 1_000_000, ..Input::default() },
            output: Output {
                state: State::Stopping,
                diagnostic: cause.into(),
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
            let [cycle, t, cause, force] = ["cycle", "t", "fault", "force_6"].map(place);
            let rows: Vec<Vec<f64>> = text
                .lines()
                .skip(1)
                .map(|line| line.split(',').map(|value| value.parse().unwrap()).collect())
                .collect();
            assert_eq!((rows[0][cycle], rows[rows.len() - 1][cycle]), (f64::from(first), f64::from(last)));
            for row in rows {
                assert_eq!(row.len(), columns.len());
                assert!((row[t] - (row[cycle] - f64::from(fault)) * 1e-3).abs() < 1e-9);
                assert_eq!(row[force], 7.5);
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
