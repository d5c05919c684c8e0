//! Report of a run, which `--report` writes as JSON.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tracing::{info, warn};

use super::io_thread::IoReport;
use super::log_thread::LogReport;
use super::recorder::RecorderReport;
use crate::version::VERSION;
use hexad_client::messages::{StatisticsMessage, Times, WorstCycle};
use hexad_client::realtime::cyclic::LoopReport;
use hexad_client::realtime::setup::deadline;
use hexad_client::realtime::usage::ThreadUsage;
use hexad_machine::config::Config;
use hexad_machine::text::files::{FileError, write_json};

/// Report of a run: timing, tracking, resources and faults.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// Version, commit and build profile of the daemon.
    pub version: String,
    /// Number of cycles run since start.
    pub cycles: u64,
    /// Configured rate of the cycles \[Hz\].
    pub rate_hz: f64,
    /// Numbers of cycles that were late or not run.
    pub deadline_misses: DeadlineMisses,
    /// Release to the first instruction of the cycle.
    pub wakeup_ns: Times,
    /// First instruction of the cycle to its output.
    pub compute_ns: Times,
    /// Age of the measurement at the release.
    pub measured_age_ns: Times,
    /// Release to the force message sent.
    pub end_to_end_ns: Times,
    /// The worst cycles, the worst first.
    pub worst_cycles: Vec<WorstCycle>,
    /// Tracking error over the cycles in state `active`.
    pub tracking: Tracking,
    /// Resources of the real-time thread from the first release to the end of the last cycle.
    pub rt_thread: ThreadUsage,
    /// Resources of the I/O thread. It allocates only while a peer connects or disappears.
    pub io_thread: ThreadUsage,
    /// Resources of the log thread. It allocates only to log a change of state.
    pub log_thread: ThreadUsage,
    /// Numbers of the recorder, which keeps the last seconds even without a folder.
    pub recording: RecorderReport,
    /// The first faults of the run, in the order of their cycles.
    pub faults: Vec<Fault>,
}

/// Numbers of missed deadlines, by kind.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct DeadlineMisses {
    /// Cycles that began later after their release than the configured threshold.
    pub late_wakeup: u64,
    /// Cycles still computing at their next release.
    pub overrun: u64,
    /// Release instants for which no cycle was run.
    pub skipped: u64,
    /// Cycles run at once because their release had passed; not counted as misses.
    pub caught_up: u64,
}

/// Desired minus actual pose.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Tracking {
    /// Root mean square of the distance between desired and actual position \[m\].
    pub position_rms_m: f64,
    /// Largest distance between desired and actual position \[m\].
    pub position_max_m: f64,
    /// Root mean square of the angle between desired and actual orientation \[rad\].
    pub orientation_rms_rad: f64,
    /// Largest angle between desired and actual orientation \[rad\].
    pub orientation_max_rad: f64,
}

/// Fault that ended control.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Fault {
    /// Number of the cycle that entered the fault, from 1.
    pub cycle: u64,
    /// Number of the [`DiagnosticCode`](hexad_core::control::signals::diagnostic::DiagnosticCode).
    pub number: u32,
    /// Name of that code, in words.
    pub name: String,
}

impl Report {
    /// Combines the reports of the three threads. Logs a warning for each loss of data.
    pub(super) fn new(config: &Config, cyclic: &LoopReport, io: &IoReport, log: LogReport) -> Self {
        warn_of_losses(cyclic, io);
        let counters = &cyclic.counters;
        let StatisticsMessage { total, worst, .. } = log.statistics;
        let report = Self {
            version: VERSION.into(),
            cycles: counters.cycles,
            rate_hz: config.deployment.realtime.rate_hz,
            deadline_misses: DeadlineMisses {
                late_wakeup: counters.late_wakeups,
                overrun: counters.overruns,
                skipped: counters.skipped,
                caught_up: counters.caught_up,
            },
            wakeup_ns: total.wakeup_ns,
            compute_ns: total.compute_ns,
            measured_age_ns: total.measured_age_ns,
            end_to_end_ns: total.end_to_end_ns,
            worst_cycles: worst.into_iter().filter(|cycle| cycle.cycle > 0).collect(),
            tracking: log.tracking.tracking(),
            rt_thread: cyclic.usage,
            io_thread: io.usage,
            log_thread: log.usage,
            recording: RecorderReport::default(),
            faults: log.faults,
        };
        report.log_timing();
        report
    }

    /// Logs the timing of the run.
    fn log_timing(&self) {
        let DeadlineMisses { late_wakeup, overrun, skipped, .. } = self.deadline_misses;
        let micros = |times: &Times| {
            let [p50, p99, max] = [times.p50, times.p99, times.max].map(|time_ns| time_ns as f64 * 1e-3);
            format!("{p50:.1} / {p99:.1} / {max:.1}")
        };
        info!(
            cycles = self.cycles,
            late_wakeup,
            overrun,
            skipped,
            "timing: p50 / p99 / max [us]: wake-up {}, compute {}, release to force sent {}",
            micros(&self.wakeup_ns),
            micros(&self.compute_ns),
            micros(&self.end_to_end_ns)
        );
    }

    /// Writes JSON.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        write_json(path, self)
    }

    /// Reads JSON.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = std::fs::read(path).map_err(FileError::on(path))?;
        serde_json::from_slice(&text).map_err(|e| FileError::on(path)(e.into()))
    }
}

fn warn_of_losses(cyclic: &LoopReport, io: &IoReport) {
    for (count, what) in [
        (
            deadline::times_exhausted(),
            "times, at least, the budget of SCHED_DEADLINE was used up: the loop was held",
        ),
        (cyclic.counters.records_lost, "cycle records lost: the log thread was too slow"),
        (io.send_failures, "messages could not be sent"),
        (io.rejected.schema, "messages rejected: another schema; build all participants alike"),
        (
            io.rejected.other_publisher,
            "messages rejected: of another publisher than the one that counts; were there two at once?",
        ),
        (io.rejected.repeated, "messages rejected: received before, or unreadable"),
        (io.rejected.damaged, "messages rejected: wrong checksum, or a publisher that begins in the future"),
    ] {
        if count > 0 {
            warn!(count, "{what}");
        }
    }
}

/// Sums and maxima of tracking errors.
#[derive(Clone, Copy, Debug, Default)]
pub struct TrackingSum {
    count: u64,
    position_squares: f64,
    orientation_squares: f64,
    position_max: f64,
    orientation_max: f64,
}

impl TrackingSum {
    /// Adds one pair of error norms: \[m\], \[rad\].
    pub fn add(&mut self, position: f64, orientation: f64) {
        self.count += 1;
        self.position_squares += position * position;
        self.orientation_squares += orientation * orientation;
        self.position_max = self.position_max.max(position);
        self.orientation_max = self.orientation_max.max(orientation);
    }

    /// Number of pairs.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// RMS and maxima; zero if nothing was added.
    pub fn tracking(&self) -> Tracking {
        let count = self.count.max(1) as f64;
        Tracking {
            position_rms_m: (self.position_squares / count).sqrt(),
            position_max_m: self.position_max,
            orientation_rms_rad: (self.orientation_squares / count).sqrt(),
            orientation_max_rad: self.orientation_max,
        }
    }
}
