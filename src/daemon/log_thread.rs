//! The log thread. It turns the records of the real-time thread and the I/O thread into statistics and log
//! lines, and passes each cycle to the recorder.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;
use std::sync::mpsc::{Sender, SyncSender};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Instant;

use heapless::spsc::Consumer;
use tracing::{error, info, warn};

use super::cycle::{CycleRecord, message, tracking_error};
use super::hints::{SlowCycleHints, ThreadFiles};
use super::pose_search::PoseSearch;
use super::process_names::sentence;
use super::recorder::Recorded;
use super::reload::Loaded;
use super::reload::handover::{Answer, Offer};
use super::report::{Fault, TrackingSum};
use super::statistics::CycleStatistics;
use hexad_client::messages::StatisticsMessage;
use hexad_client::realtime::triple_buffer::Writer;
use hexad_client::realtime::usage::ThreadUsage;
use hexad_core::control::controller::Output;
use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad_core::control::signals::inputs::{Input, Publishers};
use hexad_core::control::signals::state::State;

/// Interval at which the queues are emptied. They are not nearly full after it, even at the highest rate.
const PERIOD: Duration = Duration::from_millis(20);

/// Length of a window of the statistics.
const WINDOW: Duration = Duration::from_secs(1);

/// Largest number of faults in the report; more would not help to find their cause.
const MAX_FAULTS: usize = 1000;

/// Links of the log thread to the other threads.
pub struct LogLinks<'a, 'o> {
    pub records: Consumer<'a, CycleRecord>,
    /// Delays from release to force sent \[ns\], from the I/O thread.
    pub delays: Consumer<'a, u64>,
    /// Statistics, to the I/O thread.
    pub statistics: Writer<StatisticsMessage>,
    /// Kernel files of the real-time thread, once it has begun.
    pub files: &'a OnceLock<ThreadFiles>,
    /// Queue to the recorder. If it is full, cycles are lost, unless this thread may hold the loop.
    pub recorder: SyncSender<Recorded>,
    /// Number of the last cycle that was passed on.
    pub passed_on: &'a AtomicU64,
    /// Whether time is simulated, so that the loop waits for the recorder.
    pub may_hold_loop: bool,
    /// Offers that the real-time thread has answered. They return to the reload thread.
    pub answers: Consumer<'a, &'o mut Offer>,
    pub returned: Sender<&'o mut Offer>,
    pub pose_search: PoseSearch,
}

/// Statistics of a run.
#[derive(Debug, Default)]
pub struct LogReport {
    pub statistics: StatisticsMessage,
    pub counts_csv: String,
    pub tracking: TrackingSum,
    pub faults: Vec<Fault>,
    pub usage: ThreadUsage,
}

/// Runs until `stop` and until the queues are empty.
pub fn run(mut links: LogLinks<'_, '_>, stop: &AtomicBool) -> LogReport {
    let at_start = ThreadUsage::of_this_thread();
    let mut log = Log::default();
    log.report.faults.reserve(MAX_FAULTS);
    let mut window_began = Instant::now();
    loop {
        let stopping = stop.load(Ordering::Relaxed);
        log.empty_queues(&mut links);
        if window_began.elapsed() >= WINDOW {
            window_began = Instant::now();
            links.statistics.write(log.collector.end_window());
        }
        if stopping {
            let usage = ThreadUsage::of_this_thread().since(&at_start);
            let (statistics, counts_csv) = (log.collector.statistics(), log.collector.counts_csv());
            return LogReport { statistics, counts_csv, usage, ..log.report };
        }
        thread::sleep(PERIOD);
    }
}

/// State of the log thread.
#[derive(Default)]
struct Log<'o> {
    collector: CycleStatistics,
    report: LogReport,
    /// State and diagnostic of the last cycle.
    state: (State, DiagnosticCode),
    /// The last two simultaneous publishers, of measurements and of setpoints.
    publishers: [Publishers; 2],
    hints: SlowCycleHints,
    /// Answered offer whose first cycle has not arrived yet.
    offer: Option<&'o mut Offer>,
    /// Configuration of the next cycles, while the recorder has no room for it.
    unrecorded: Option<Arc<Loaded>>,
}

impl<'o> Log<'o> {
    fn empty_queues(&mut self, links: &mut LogLinks<'_, 'o>) {
        while let Some(record) = links.records.dequeue() {
            self.collector.add(&record);
            self.return_offer(links, record.cycle);
            self.record(links, &record);
            links.pose_search.add(&record);
            links.passed_on.store(record.cycle, Ordering::Relaxed);
            if let Some((position, orientation)) = tracking_error(&record) {
                self.report.tracking.add(position, orientation);
            }
            self.log_publishers(&record);
            let state = (record.output.state, record.output.diagnostic.code);
            if state != self.state {
                self.log_state(&record);
                self.state = state;
            }
        }
        while let Some(delay_ns) = links.delays.dequeue() {
            self.collector.add_delay(delay_ns);
        }
        if let Some(files) = links.files.get() {
            let hints = files.read();
            self.collector.add_hints(&hints.since(&self.hints));
            self.hints = hints;
        }
    }

    /// Returns an offer before the first cycle with its constants, because the recorder needs them before
    /// that cycle.
    fn return_offer(&mut self, links: &mut LogLinks<'_, 'o>, cycle: u64) {
        // The answer is written before the record of its cycle.
        self.offer = self.offer.take().or_else(|| links.answers.dequeue());
        let Some(offer) = self.offer.take_if(|offer| offer.is_due(cycle)) else { return };
        if let Answer::Taken(_) = offer.answer {
            self.unrecorded = Some(offer.loaded.clone());
        }
        // The receiver is gone when the daemon ends.
        let _ = links.returned.send(offer);
    }

    /// Passes a cycle to the recorder, after its configuration if that is new. If the queue is full, both are
    /// lost, unless the loop may be held.
    fn record(&mut self, links: &LogLinks<'_, 'o>, record: &CycleRecord) {
        let send = |recorded| match links.may_hold_loop {
            true => links.recorder.send(recorded).is_ok(),
            false => links.recorder.try_send(recorded).is_ok(),
        };
        if let Some(loaded) = &self.unrecorded {
            if !send(Recorded::Configuration(loaded.clone())) {
                return;
            }
            self.unrecorded = None;
        }
        send(Recorded::Cycle(message(record)));
    }

    /// Logs a second publisher, also under control, where it has no effect.
    fn log_publishers(&mut self, record: &CycleRecord) {
        let Input { measured_publishers, setpoint_publishers, .. } = record.input;
        let now = [measured_publishers, setpoint_publishers];
        let codes = [DiagnosticCode::TwoMeasuredSources, DiagnosticCode::TwoSetpointSources];
        for ((before, now), code) in self.publishers.iter_mut().zip(now).zip(codes) {
            // Once for each pair, even if one of them is silent at times.
            if now.ignored_pid_or_0 != 0 && now != *before {
                *before = now;
                let two = Diagnostic::new(code, now.used_pid.into(), now.ignored_pid_or_0.into());
                warn!(cycle = record.cycle, number = code as u32, "{}", sentence(&two));
            }
        }
    }

    fn log_state(&mut self, record: &CycleRecord) {
        let CycleRecord { cycle, output: Output { state, diagnostic, .. }, .. } = *record;
        let Diagnostic { code, value, bound, .. } = diagnostic;
        let (name, number) = (state.name(), code as u32);
        match state {
            State::Fault => {
                error!(
                    cycle,
                    state = name,
                    code = number,
                    value,
                    bound,
                    "fault: {diagnostic}; no force until cleared"
                );
                let faults = &mut self.report.faults;
                if faults.len() < MAX_FAULTS {
                    faults.push(Fault { cycle, number: code as u32, name: code.name().into() });
                }
            }
            State::Engaging | State::Active => {
                info!(cycle, state = name, code = number, "{name}: forces are valid");
            }
            State::Stopping if code.is_fault() => {
                warn!(
                    cycle,
                    state = name,
                    code = number,
                    value,
                    bound,
                    "stopping: {}",
                    sentence(&diagnostic)
                );
            }
            _ => info!(cycle, state = name, code = number, value, bound, "{name}: {}", sentence(&diagnostic)),
        }
    }
}
