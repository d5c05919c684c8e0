//! The threads of the daemon: start, supervision, end.

use core::mem;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::io;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::thread::{self, Builder, Scope, ScopedJoinHandle, scope};
use std::time::{Duration, Instant};

use heapless::spsc::{Producer, Queue};
use tracing::{info, warn};

use super::control_socket::location::ControlSocket;
use super::control_socket::{self, ControlLinks};
use super::cycle::{self, CycleRecord, RealtimeSide, RequestIntake};
use super::emergency_latch::{EmergencyLatch, latch_link};
use super::end_watch::end_watch;
use super::hints::ThreadFiles;
use super::io_thread::{self, DELAYS, IoLinks, IoReport, IoSettings, Ports};
use super::leg_confirmation::LegConfirmation;
use super::log_thread::{self, LogLinks, LogReport};
use super::memory_queue::{MemoryProducer, MemoryQueue};
use super::motion_requests;
use super::parameters::{nanoseconds, timing};
use super::pose_gate::{PoseGate, PoseWatch};
use super::pose_search::PoseSearch;
use super::recorder::{Folders, Recorder, RecorderReport};
use super::reload::handover::{Handover, Offer, OfferQueue};
use super::reload::io_parameters::IoParametersInForce;
use super::reload::{self, Loaded, ReloadLinks, Requester};
use super::report::Report;
use super::snapshot::Snapshot;
use super::start::{
    RECORDS_PRIORITY, REQUESTS_PRIORITY, Ready, prepare_io, prepare_loop, prepare_simulated, prepare_support,
    start, warm_up,
};
use super::supervision::{Progress, SUPERVISION_INTERVAL, Supervision};
use super::{DaemonError, REALTIME_THREAD};
use hexad_client::messages::StatisticsMessage;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::realtime::clock::Monotonic;
use hexad_client::realtime::cyclic::{LoopReport, RECORD_QUEUE_LENGTH, ReleaseMode};
use hexad_client::realtime::event::Event;
use hexad_client::realtime::exchange::exchange;
use hexad_client::realtime::process::block_signals;
use hexad_client::realtime::request_word::RequestWord;
use hexad_client::realtime::setup::memory;
use hexad_client::realtime::stop_request::Stop;
use hexad_client::realtime::triple_buffer::triple_buffer;
use hexad_core::control::controller::{Controller, Output};
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::inputs::Input;
use hexad_core::control::signals::state::Request;
use hexad_machine::config::Config;

/// Stack of each thread: twice the size used, and small because all of it is locked. The recorder uses most:
/// 495 KB if the crate is one codegen unit, 555 KB with several (2026-11-25). Unoptimized code keeps every
/// intermediate value on the stack.
pub(super) const STACK_BYTES: usize = if cfg!(debug_assertions) { 8 << 20 } else { 1 << 20 };

/// Longest wait for the platform to come to rest before the daemon ends, below the stop timeout of a service
/// manager.
const MAX_STOP_TIME: Duration = Duration::from_secs(10);
const REST_POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Flags between the threads.
#[derive(Default)]
struct Flags {
    stop_loop: AtomicBool,
    stop_io: AtomicBool,
    stop_control: AtomicBool,
    stop_log: AtomicBool,
    stop_latch: AtomicBool,
    /// Set when the daemon is to end. The platform then comes to rest.
    is_ending: AtomicBool,
    /// Set when the daemon is to end and the platform is not under control.
    may_end: AtomicBool,
    /// Number of the last cycle that the log thread has passed on. In lock-step the next cycles wait for it.
    passed_on: AtomicU64,
}

/// Runs the threads until `stop`. Returns the report, and the histograms as CSV.
#[expect(
    clippy::too_many_lines,
    reason = "all threads and the queues between them are in one function, to be read together"
)]
pub(super) fn run(
    loaded: Loaded,
    folders: &Folders,
    (latch, legs): (Option<EmergencyLatch>, Option<Arc<LegConfirmation>>),
    socket: ControlSocket,
    word: &'static RequestWord,
    stop: &Stop,
) -> Result<(Report, String), DaemonError> {
    let (io_parameters, loaded) = (&IoParametersInForce::new(&loaded.io_parameters()), Arc::new(loaded));
    let (config, controller) = (&loaded.config, loaded.controller.clone());
    let mut memory_queue = Box::new(MemoryQueue::new());
    let (memory_producer, memories) = memory_queue.split();
    let (recorder, recorder_links) = Recorder::new(&loaded, memories, folders);
    let mut offer = Box::new(Offer::new(loaded.clone()));
    let (mut offer_queue, mut answer_queue) = (OfferQueue::new(), OfferQueue::new());
    let ((offer_producer, offers), (answer_producer, answers)) = (offer_queue.split(), answer_queue.split());
    let ((request_reload, reload_requests), (reload_results, reloaded)) = (channel(), channel());
    let (return_offer, returned) = channel();
    let (realtime_side, io_side) = exchange();
    let event = io_side.event.clone();
    let mut record_queue = Box::new(Queue::<CycleRecord, RECORD_QUEUE_LENGTH>::new());
    let (record_producer, records) = record_queue.split();
    let mut delay_queue = Box::new(Queue::<u64, DELAYS>::new());
    let (delay_producer, delays) = delay_queue.split();
    let (statistics_writer, statistics) = triple_buffer(StatisticsMessage::default());
    let (snapshot_writer, snapshots) = triple_buffer(Snapshot::default());
    let ((motion_snapshots, motion_reader), (jobs, received_jobs)) =
        (triple_buffer(Snapshot::default()), channel());
    let (latch, latch_link) = latch
        .map(|latch| {
            let (link, changes) = latch_link();
            ((latch, changes), link)
        })
        .unzip();
    let (flags, progress, files) = (&Flags::default(), &Progress::default(), &OnceLock::new());
    let ((io_ready, ready), (go, go_ahead)) = (channel(), channel());
    memory::keep_heap();

    let gate = Arc::new(PoseGate::new());
    let may_hold_loop = config.deployment.realtime.release == ReleaseMode::Lockstep;
    let log_links = LogLinks {
        records,
        delays,
        statistics: statistics_writer,
        files,
        recorder: recorder_links.cycles,
        passed_on: &flags.passed_on,
        may_hold_loop,
        answers,
        returned: return_offer,
        pose_search: PoseSearch::new(&config.machine, gate.clone(), may_hold_loop),
    };
    let realtime_links = RealtimeLinks {
        exchange: realtime_side,
        records: record_producer,
        memories: MemoryProducer::new(memory_producer),
        word,
        watch: PoseWatch::new(gate.clone()),
        handover: Handover::new(offers, answer_producer, io_parameters),
        progress,
        files,
        ready: io_ready.clone(),
        go_ahead,
    };
    let io_links = IoLinks {
        exchange: io_side,
        delays: delay_producer,
        statistics,
        snapshots: snapshot_writer,
        latch: latch_link,
        word,
        parameters: io_parameters,
        is_ending: &flags.is_ending,
        may_end: &flags.may_end,
        passed_on: &flags.passed_on,
        gate: gate.clone(),
        progress,
    };
    let control_links = ControlLinks {
        socket,
        snapshots,
        word,
        gate,
        request_reload: request_reload.clone(),
        reloaded,
        windows: recorder_links.orders,
        interruption: recorder_links.interruption,
        legs,
        jobs,
        motion_snapshots,
        is_ending: &flags.is_ending,
    };
    let reload_links =
        ReloadLinks { requests: reload_requests, results: reload_results, offers: offer_producer, returned };
    let mut ending = None;
    let outcome = scope(|threads| {
        // Ends the other threads also if a thread cannot be started.
        let _stop_all = StopOnDrop(flags);
        let realtime = &config.deployment.realtime;
        let run_control = || {
            prepare_support(realtime, REQUESTS_PRIORITY);
            control_socket::run(loaded.clone(), control_links, &flags.stop_control);
        };
        spawn(threads, "hexad-reload", || reload::run(loaded.clone(), &mut offer, reload_links))?;
        let home = config.machine.home;
        spawn(threads, "hexad-motion", move || motion_requests::run(home, &received_jobs, motion_reader))?;
        let control = spawn(threads, "hexad-control", run_control)?;
        let recorder = spawn(threads, "hexad-recorder", || {
            prepare_support(realtime, RECORDS_PRIORITY);
            recorder.run()
        })?;
        let latch = latch
            .map(|(latch, changes)| {
                spawn(threads, "hexad-latch", move || latch.run(changes, &flags.stop_latch))
            })
            .transpose()?;
        let log = spawn(threads, "hexad-log", || {
            prepare_support(realtime, RECORDS_PRIORITY);
            log_thread::run(log_links, &flags.stop_log)
        })?;
        let cyclic = spawn(threads, REALTIME_THREAD, || {
            run_realtime(config, controller, realtime_links, &flags.stop_loop)
        })?;
        let io = spawn(threads, "hexad-io", move || run_io(config, io_links, &io_ready, &flags.stop_io))?;

        let started = start(realtime, &ready, &go);
        if started.is_ok() {
            supervise(config, flags, progress, &request_reload, word, stop);
        }
        drop((go, request_reload));
        ending = end_watch();
        let reports = join(flags, &event, cyclic, io, log, control);
        let _pm_qos = started?;
        flags.stop_latch.store(true, Ordering::Relaxed);
        latch.map_or(Ok(()), |latch| latch.join().map_err(|_| DaemonError::Died("latch")))?;
        let recorded = recorder.join().map_err(|_| DaemonError::Died("recorder"));
        let (cyclic, io, log) = reports?;
        Ok(report(config, &cyclic, &io, log, recorded?))
    });
    drop(ending);
    outcome
}

/// The report of a run, and the histograms as CSV.
fn report(
    config: &Config,
    cyclic: &LoopReport,
    io: &IoReport,
    mut log: LogReport,
    recording: RecorderReport,
) -> (Report, String) {
    let counts_csv = mem::take(&mut log.counts_csv);
    (Report { recording, ..Report::new(config, cyclic, io, log) }, counts_csv)
}

/// Links of the real-time thread to the other threads.
struct RealtimeLinks<'a, 'o> {
    exchange: RealtimeSide,
    records: Producer<'a, CycleRecord>,
    /// Copies of the controller's memory, to the recorder.
    memories: MemoryProducer<'a>,
    /// Request word of the control thread and of signals.
    word: &'static RequestWord,
    /// Other poses in which the platform may be.
    watch: PoseWatch,
    /// Offers of new constants.
    handover: Handover<'a, 'o>,
    /// Progress, for the main thread.
    progress: &'a Progress,
    /// Set by this thread: its files of the kernel.
    files: &'a OnceLock<ThreadFiles>,
    ready: Sender<Ready>,
    go_ahead: Receiver<()>,
}

/// Body of the real-time thread; `None` if the daemon did not start.
fn run_realtime(
    config: &Config,
    mut controller: Controller,
    links: RealtimeLinks<'_, '_>,
    stop: &AtomicBool,
) -> Option<LoopReport> {
    let realtime = &config.deployment.realtime;
    let warm_up = || warm_up(controller.clone(), &config.machine);
    let shortfalls =
        if realtime.is_simulated() { prepare_simulated(warm_up) } else { prepare_loop(realtime, warm_up) };
    let _ = links.ready.send(Ok(shortfalls));
    // If this fails, the worst cycles have no hints.
    let _ = ThreadFiles::of_this_thread().map(|found| links.files.set(found));
    // No cycle begins before the main thread has accepted the shortfalls of all threads.
    links.go_ahead.recv().ok()?;
    let (word, progress, mut intake) = (links.word, links.progress, RequestIntake::default());
    let (mut handover, mut memories, mut watch) = (links.handover, links.memories, links.watch);
    let step = |input: &mut Input, woke_ns: u64| {
        progress.count_cycle();
        handover.answer_offer(&mut controller, woke_ns);
        memories.begin_cycle(controller.memory());
        input.request = intake.next(word.load(), woke_ns, input.release_ns);
        watch.apply_search_result(input);
        let output = controller.step(input);
        watch.end_cycle(input.release_ns, output.platform.map(|platform| platform.pose));
        output
    };
    let last = Output { diagnostic: DiagnosticCode::DaemonEnding.into(), ..Output::default() };
    let timing = timing(&config.deployment);
    Some(cycle::run(&mut Monotonic, &timing, step, last, links.exchange, links.records, stop))
}

/// Body of the I/O thread; `None` if its ports could not be opened.
fn run_io(config: &Config, links: IoLinks<'_>, ready: &Sender<Ready>, stop: &AtomicBool) -> Option<IoReport> {
    let Config { machine, deployment, .. } = config;
    let realtime = &deployment.realtime;
    // Ports belong to the thread that opens them, so they are opened here.
    let ports = config.join().and_then(|bus| Ports::open(&bus, &links.parameters.get()));
    let (ports, opened) = ports.map_or_else(|error| (None, Err(error)), |ports| (Some(ports), Ok(())));
    let shortfalls = opened.map(|()| if realtime.is_simulated() { vec![] } else { prepare_io(realtime) });
    // There is no receiver only if another thread failed first.
    let _ = ready.send(shortfalls.map_err(DaemonError::from));
    let settings = IoSettings {
        timing: timing(deployment),
        lead_ns: nanoseconds(realtime.io_lead_s),
        home: machine.home,
    };
    Some(io_thread::run(&settings, ports?, links, stop))
}

/// Supervises the threads until `stop`, and then until the platform is at rest.
fn supervise(
    config: &Config,
    flags: &Flags,
    progress: &Progress,
    request_reload: &Sender<Requester>,
    word: &RequestWord,
    stop: &Stop,
) {
    let realtime = &config.deployment.realtime;
    let mut supervision =
        Supervision::begin(progress, realtime.rate_hz, realtime.is_simulated(), request_reload);
    info!(name = %config.name, rate_hz = realtime.rate_hz, "running");
    while !stop.is_requested() {
        supervision.step();
        stop.wait(SUPERVISION_INTERVAL);
    }
    supervision.end();
    info!("stopping");
    // In this order: what is asked for after the stop is refused, and the stop overrules what was asked for before it.
    flags.is_ending.store(true, Ordering::Relaxed);
    word.post(Request::Stop as u32, monotonic_ns());
    let began = Instant::now();
    while !flags.may_end.load(Ordering::Relaxed) {
        if stop.is_repeated() || began.elapsed() > MAX_STOP_TIME {
            warn!("the platform did not come to rest: ending all the same");
            return;
        }
        supervision.step();
        thread::sleep(REST_POLL_INTERVAL);
    }
}

/// Ends the threads one after another, so that each receives the last output of the thread before it.
fn join(
    flags: &Flags,
    event: &Arc<Event>,
    cyclic: ScopedJoinHandle<'_, Option<LoopReport>>,
    io: ScopedJoinHandle<'_, Option<IoReport>>,
    log: ScopedJoinHandle<'_, LogReport>,
    control: ScopedJoinHandle<'_, ()>,
) -> Result<(LoopReport, IoReport, LogReport), DaemonError> {
    flags.stop_loop.store(true, Ordering::Relaxed);
    event.signal();
    let cyclic = cyclic.join().map_err(|_| DaemonError::Died("real-time"));
    flags.stop_io.store(true, Ordering::Relaxed);
    let io = io.join().map_err(|_| DaemonError::Died("io"));
    flags.stop_control.store(true, Ordering::Relaxed);
    let control = control.join().map_err(|_| DaemonError::Died("control"));
    flags.stop_log.store(true, Ordering::Relaxed);
    let log = log.join().map_err(|_| DaemonError::Died("log"));
    control?;
    Ok((cyclic?.unwrap_or_default(), io?.unwrap_or_default(), log?))
}

/// Stops every thread when dropped.
struct StopOnDrop<'a>(&'a Flags);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        let Flags { stop_loop, stop_io, stop_control, stop_log, stop_latch, .. } = self.0;
        [stop_loop, stop_io, stop_control, stop_log, stop_latch]
            .into_iter()
            .for_each(|flag| flag.store(true, Ordering::Relaxed));
    }
}

fn spawn<'scope, T: Send + 'scope>(
    threads: &'scope Scope<'scope, '_>,
    name: &str,
    body: impl FnOnce() -> T + Send + 'scope,
) -> io::Result<ScopedJoinHandle<'scope, T>> {
    let body = || {
        // Signals of the process go to the main thread, which waits for them.
        block_signals();
        body()
    };
    Builder::new().name(name.into()).stack_size(STACK_BYTES).spawn_scoped(threads, body)
}
