//! The log thread: turns the records of the other two threads into statistics and into words.

use super::cycle::{CycleRecord, tracking_error};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::OnceLock;
use std::thread;
use std::time::Instant;

use heapless::spsc::Consumer;
use tracing::{info, warn};

use super::fault_dump::FaultDump;
use super::first_pose::FirstPose;
use super::hints::{Hints, ThreadFiles};
use super::statistics::Collector;
use crate::control::controller::Output;
use crate::control::diagnostic::DiagnosticCode;
use crate::control::state::State;
use crate::daemon::report::{Fault, TrackingSum};
use crate::messages::statistics::Statistics;
use crate::realtime::triple_buffer::Writer;
use crate::realtime::usage::ThreadUsage;

/// How often the queues are emptied: well before they are full at the highest rate.
const PERIOD: Duration = Duration::from_millis(20);

/// Length of a window of the statistics.
const WINDOW: Duration = Duration::from_secs(1);

/// Faults kept for the report; a machine that faults more often has told enough.
const MAX_FAULTS: usize = 1000;

/// What the log thread reads and where it tells.
pub struct Sides<'a> {
    pub records: Consumer<'a, CycleRecord>,
    /// Release to force sent \[ns\], from the io thread.
    pub sent: Consumer<'a, u64>,
    /// For the status message.
    pub statistics: Writer<Statistics>,
    /// Of the real-time thread, once it has begun.
    pub files: &'a OnceLock<ThreadFiles>,
    pub dump: FaultDump,
    pub first_pose: FirstPose,
}

/// Statistics of a run.
#[derive(Debug, Default)]
pub struct LogReport {
    pub statistics: Statistics,
    pub counts_csv: String,
    pub tracking: TrackingSum,
    pub faults: Vec<Fault>,
    pub usage: ThreadUsage,
}

/// Runs until `stop` and until the queues are empty.
pub fn run(mut sides: Sides<'_>, stop: &AtomicBool) -> LogReport {
    let mut collector = Collector::default();
    let mut report = LogReport { faults: Vec::with_capacity(MAX_FAULTS), ..LogReport::default() };
    let mut last = (State::Off, DiagnosticCode::None);
    let mut hints = Hints::default();
    let mut window_began = Instant::now();
    let at_start = ThreadUsage::of_this_thread();
    loop {
        let stopping = stop.load(Ordering::Relaxed);
        while let Some(record) = sides.records.dequeue() {
            collector.add(&record);
            sides.dump.add(&record);
            sides.first_pose.add(&record);
            if let Some((position, orientation)) = tracking_error(&record) {
                report.tracking.add(position, orientation);
            }
            let now = (record.output.state, record.output.diagnostic.code);
            if now != last {
                tell(&record, &mut report.faults);
                last = now;
            }
        }
        while let Some(end_to_end_ns) = sides.sent.dequeue() {
            collector.add_sent(end_to_end_ns);
        }
        if let Some(files) = sides.files.get() {
            let now = files.read();
            collector.hint(&now.since(&hints));
            hints = now;
        }
        if window_began.elapsed() >= WINDOW {
            window_began = Instant::now();
            sides.statistics.write(collector.end_window());
        }
        sides.dump.step();
        if stopping {
            sides.dump.finish();
            report.statistics = collector.statistics();
            report.usage = ThreadUsage::of_this_thread().since(&at_start);
            report.counts_csv = collector.counts_csv();
            return report;
        }
        thread::sleep(PERIOD);
    }
}

fn tell(record: &CycleRecord, faults: &mut Vec<Fault>) {
    let CycleRecord { cycle, output: Output { state, diagnostic, .. }, .. } = *record;
    let code = diagnostic.code;
    match state {
        State::Fault => {
            warn!(cycle, number = code as u32, "fault: {diagnostic}; no force until cleared");
            if faults.len() < MAX_FAULTS {
                faults.push(Fault { cycle, number: code as u32, name: code.name().into() });
            }
        }
        State::Engaging | State::Active => info!(cycle, "{}: forces are valid", state.name()),
        State::Stopping if code.is_fault() => {
            warn!(cycle, number = code as u32, "stopping: {diagnostic}")
        }
        _ => info!(cycle, "{}: {diagnostic}", state.name()),
    }
}
