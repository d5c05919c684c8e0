//! `hexad run`: the daemon.
//!
//! Start: configuration, ports, threads, real-time set-up; only then the first release. Stop, in this
//! order: the platform comes to rest, the real-time thread ends its cycle and says that no force is valid, the io thread publishes
//! that, the log thread empties its queue, the report is written.

use self::cycle::CycleRecord;
use core::mem;
use core::sync::atomic::{AtomicBool, Ordering};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{OnceLock, mpsc};
use std::thread::{self, Builder, Scope, ScopedJoinHandle, scope};
use std::time::{Duration, Instant};

use heapless::spsc::Queue;
use sd_notify::NotifyState;
use tracing::{info, warn};

use self::fault_dump::FaultDump;
use self::first_pose::FirstPose;
use self::hints::ThreadFiles;
use self::io_thread::{DELAYS, IoReport, Ports, Settings};
use self::log_thread::LogReport;
use self::report::{DeadlineMisses, Report};
use self::start::{prepare_io, prepare_loop, prepare_simulated, start, warm_up};
use crate::config::control_loops::{ControlLoop, loops};
use crate::config::deployment::{Deployment, ReleaseMode};
use crate::config::{Config, fidelity};
use crate::control::controller::{Controller, Input, Output};
use crate::control::diagnostic::DiagnosticCode;
use crate::control::gains::Gains;
use crate::control::law::Law;
use crate::control::parameters::{Envelope, Parameters};
use crate::messages::ports::{Bus, PortError, Time};
use crate::messages::statistics::Statistics;
use crate::model::fidelity::Fidelity;
use crate::model::machine::Machine;
use crate::output::files::{FileError, write_whole};
use crate::realtime::clock::Monotonic;
use crate::realtime::cyclic;
use crate::realtime::cyclic::{LoopReport, RECORDS, Release, Timing};
use crate::realtime::exchange::exchange;
use crate::realtime::process::block_signals;
use crate::realtime::setup::{Shortfall, deadline, memory};
use crate::realtime::stop_request::Stop;
use crate::realtime::triple_buffer::triple_buffer;

pub mod cycle;
mod fault_dump;
mod first_pose;
mod hints;
mod io_thread;
mod log_thread;
pub mod report;
pub mod start;
mod statistics;
pub mod time_histogram;
mod translation;

/// Name of the real-time thread, by which a running daemon is found.
pub const REALTIME_THREAD: &str = "hexad-rt";

/// Stack of each thread: several times what they use, and small because locked memory holds all of it. A debug build keeps
/// every intermediate value there.
const STACK: usize = if cfg!(debug_assertions) { 8 << 20 } else { 512 * 1024 };

/// Longest the daemon waits for the platform to come to rest before it ends: a service manager's patience
/// is longer.
const LONGEST_STOP: Duration = Duration::from_secs(10);
const REST_POLL: Duration = Duration::from_millis(2);

/// Why the daemon did not run.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error("cannot start a thread: {0}")]
    Thread(#[from] io::Error),
    #[error("realtime.require_realtime is set, and there is {}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    NotRealtime(Vec<Shortfall>),
    #[error("the {0} thread ended unexpectedly")]
    Died(&'static str),
    #[error(transparent)]
    Report(#[from] FileError),
}

/// What the daemon writes, if it shall.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// JSON, at the end.
    pub report: Option<PathBuf>,
    /// How often each time occurred, as CSV, at the end.
    pub histogram: Option<PathBuf>,
    /// Folder for the cycles around each fault.
    pub faults: Option<PathBuf>,
}

/// Runs until `stop`.
pub fn run(config: &Config, files: &Files, stop: &Stop) -> Result<Report, DaemonError> {
    let _only = Bus::claim(&config.name)?;
    let (report, counts_csv) = run_threads(config, files.faults.as_deref(), stop)?;
    if let Some(path) = &files.report {
        report.write(path)?;
    }
    if let Some(path) = &files.histogram {
        write_whole(path, counts_csv.as_bytes())?;
    }
    Ok(report)
}

fn run_threads(config: &Config, faults: Option<&Path>, stop: &Stop) -> Result<(Report, String), DaemonError> {
    let Config { machine, deployment, .. } = config;
    let parameters = parameters(machine, deployment, fidelity::fidelity(config));
    for warning in loops(config).iter().filter_map(ControlLoop::warning) {
        warn!("{warning}");
    }
    let mut controller = Controller::new(machine, parameters);
    let timing = &timing(deployment);
    let (realtime_side, io_side) = exchange();
    let event = io_side.event.clone();
    let mut queue = Box::new(Queue::<CycleRecord, RECORDS>::new());
    let (records_in, records) = queue.split();
    let mut delays = Box::new(Queue::<u64, DELAYS>::new());
    let (sent_in, sent) = delays.split();
    let (statistics_in, statistics) = triple_buffer(Statistics::default());
    let files = &OnceLock::new();
    let [stop_loop, stop_io, stop_log] = &[const { AtomicBool::new(false) }; 3];
    let [ending, may_end] = &[const { AtomicBool::new(false) }; 2];
    let (io_ready, ready) = mpsc::channel();
    let realtime_ready = io_ready.clone();
    let (go, go_ahead) = mpsc::channel::<()>();
    let realtime = &deployment.realtime;
    memory::keep_heap();
    let settings = Settings {
        timing: *timing,
        lead_ns: nanoseconds(realtime.io_lead_s),
        longest_hold_ns: nanoseconds(deployment.timeouts.measured_s),
        time: realtime.time(),
        home: machine.home,
    };

    scope(|threads| {
        // Also when a thread cannot be started the others must end.
        let _stop_all = StopOnDrop([stop_loop, stop_io, stop_log]);
        let log = spawn(threads, "hexad-log", || {
            let dump = FaultDump::new(faults, machine.home);
            let first_pose = FirstPose::of(machine);
            let sides =
                log_thread::Sides { records, sent, statistics: statistics_in, files, dump, first_pose };
            log_thread::run(sides, stop_log)
        })?;
        let cyclic = spawn(threads, REALTIME_THREAD, move || {
            let warm_up = || warm_up(controller.clone(), machine);
            let shortfalls = match realtime.time() {
                Time::Real => prepare_loop(realtime, warm_up),
                Time::Simulated => prepare_simulated(warm_up),
            };
            let _ = realtime_ready.send(Ok(shortfalls));
            // Without them the worst cycles carry no hints.
            let _ = ThreadFiles::of_this_thread().map(|found| files.set(found));
            // Without the word of the main thread no cycle must begin.
            go_ahead.recv().ok()?;
            let step = |input: &Input| controller.step(input);
            let last = Output { diagnostic: DiagnosticCode::Stopping.into(), ..Output::default() };
            Some(cyclic::run(&mut Monotonic, timing, step, last, realtime_side, records_in, stop_loop))
        })?;
        let io = spawn(threads, "hexad-io", move || {
            // Ports belong to the thread that opens them.
            let ports = config.join().and_then(|bus| Ports::open(&bus));
            let (ports, opened) =
                ports.map_or_else(|error| (None, Err(error)), |ports| (Some(ports), Ok(())));
            let shortfalls = opened.map(|()| match realtime.time() {
                Time::Real => prepare_io(realtime),
                Time::Simulated => vec![],
            });
            // Nobody listens only if the other thread failed first.
            let _ = io_ready.send(shortfalls.map_err(DaemonError::from));
            let sides = io_thread::Sides { exchange: io_side, sent: sent_in, statistics, ending, may_end };
            Some(io_thread::run(&settings, ports?, sides, stop_io))
        })?;

        let started = start(realtime, &ready, &go);
        if started.is_ok() {
            let _ = sd_notify::notify(&[NotifyState::Ready]);
            info!(name = %config.name, rate_hz = realtime.rate_hz, "running");
            stop.wait();
            let _ = sd_notify::notify(&[NotifyState::Stopping]);
            info!("stopping");
            ending.store(true, Ordering::Relaxed);
            wait_for_rest(may_end, stop);
        }
        drop(go);
        stop_loop.store(true, Ordering::Relaxed);
        event.signal();
        let cyclic = cyclic.join().map_err(|_| DaemonError::Died("real-time"));
        stop_io.store(true, Ordering::Relaxed);
        let io = io.join().map_err(|_| DaemonError::Died("io"));
        stop_log.store(true, Ordering::Relaxed);
        let log = log.join().map_err(|_| DaemonError::Died("log"));
        let _shallow_sleep = started?;
        let (cyclic, io, mut log) = (cyclic?.unwrap_or_default(), io?.unwrap_or_default(), log?);
        let counts_csv = mem::take(&mut log.counts_csv);
        Ok((summary(config, &cyclic, &io, log), counts_csv))
    })
}

/// A platform under control is brought to rest before nobody controls it any more.
fn wait_for_rest(may_end: &AtomicBool, stop: &Stop) {
    let began = Instant::now();
    while !may_end.load(Ordering::Relaxed) {
        if stop.is_repeated() || began.elapsed() > LONGEST_STOP {
            warn!("the platform did not come to rest: ending without");
            return;
        }
        thread::sleep(REST_POLL);
    }
}

/// Sets every flag when dropped.
struct StopOnDrop<'a>([&'a AtomicBool; 3]);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.iter().for_each(|flag| flag.store(true, Ordering::Relaxed));
    }
}

fn spawn<'scope, T: Send + 'scope>(
    threads: &'scope Scope<'scope, '_>,
    name: &str,
    body: impl FnOnce() -> T + Send + 'scope,
) -> io::Result<ScopedJoinHandle<'scope, T>> {
    let body = || {
        // The main thread waits for them.
        block_signals();
        body()
    };
    Builder::new().name(name.into()).stack_size(STACK).spawn_scoped(threads, body)
}

/// What a deployment means to the controller; `fidelity` is what its fidelity came to.
pub fn parameters(machine: &Machine, deployment: &Deployment, fidelity: Fidelity) -> Parameters {
    let Deployment { control, timeouts, limits, .. } = deployment;
    let envelope = deployment.envelope.map(|limits| {
        let home = nalgebra::Vector6::from(machine.home);
        let from_home = |offsets: [f64; 6]| (home + nalgebra::Vector6::from(offsets)).into();
        Envelope { lowest: from_home(limits.pose_min), highest: from_home(limits.pose_max) }
    });
    Parameters {
        period_ns: nanoseconds(deployment.realtime.period_s()),
        law: Law::new(
            machine,
            control.mode,
            [
                Gains::new(control.position_bandwidth_hz, control.position_damping_ratio),
                Gains::new(control.orientation_bandwidth_hz, control.orientation_damping_ratio),
            ],
            control.leg_masses,
            core::f64::consts::TAU * control.observer_bandwidth_hz,
            &limits.reference,
        ),
        fidelity,
        engage_position: control.engage_position_m,
        engage_orientation: control.engage_orientation_rad,
        following_position: control.following_position_m,
        following_orientation: control.following_orientation_rad,
        setpoint_timeout_ns: nanoseconds(timeouts.setpoint_s),
        measured_timeout_ns: nanoseconds(timeouts.measured_s),
        limits: limits.reference,
        force_rate: limits.force_rate_n_s,
        condition: limits.condition,
        envelope,
        after_loss: control.on_setpoint_lost,
    }
}

/// When the loop is released and what is late.
pub(super) fn timing(deployment: &Deployment) -> Timing {
    let Deployment { realtime, timeouts, .. } = deployment;
    let period_ns = nanoseconds(realtime.period_s());
    Timing {
        period_ns,
        phase_ns: period_ns / 2,
        release: match realtime.release {
            ReleaseMode::Sleep => Release::Grid { max_lead_ns: 0 },
            ReleaseMode::Hybrid => Release::Grid { max_lead_ns: nanoseconds(realtime.max_lead_s) },
            ReleaseMode::External => Release::External { timeout_ns: nanoseconds(timeouts.measured_s) },
            // Simulated time stands while nobody measures.
            ReleaseMode::Lockstep => Release::External { timeout_ns: u64::MAX },
        },
        on_overrun: realtime.on_overrun,
        late_wakeup_ns: nanoseconds(realtime.late_wakeup_s),
    }
}

/// Seconds to nanoseconds, for durations that the configuration has bounded.
pub(super) fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

fn summary(config: &Config, cyclic: &LoopReport, io: &IoReport, log: LogReport) -> Report {
    let counters = &cyclic.counters;
    for (count, what) in [
        (
            deadline::times_exhausted(),
            "times, at least, the budget of SCHED_DEADLINE was used up: the loop was held",
        ),
        (counters.records_lost, "cycle records lost: the log thread was too slow"),
        (io.send_failures, "messages could not be sent"),
        (io.rejected.schema, "messages passed over: another schema; build all participants alike"),
        (io.rejected.older_source, "messages passed over: an older source; were there two at once?"),
        (io.rejected.repeated, "messages passed over: seen before, or unreadable"),
    ] {
        if count > 0 {
            warn!(count, "{what}");
        }
    }
    let Statistics { total, worst, .. } = log.statistics;
    Report {
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
        faults: log.faults,
    }
}
