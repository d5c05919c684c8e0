//! The recorder thread: the last cycles in memory, all of them on disk if wanted, and those around each fault.
//!
//! The log thread hands over each cycle through a bounded queue. A disk that stalls holds this thread alone; when the queue
//! is full cycles are lost, which the recording says. The thread computes each cycle again in a replica of the controller:
//! so it has the controller's memory at any cycle, and the real-time thread copies none of it.

use core::time::Duration;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};
use tracing::{info, warn};

use self::fault_watch::FaultWatch;
use self::folder::Folder;
use self::replica::Replica;
use self::stream::Stream;
use self::tape::Tape;
use super::reload::Loaded;
use crate::config::Config;
use crate::messages::CycleMessage;
use crate::messages::clock::monotonic_ns;
use crate::realtime::setup::denormals;
use crate::realtime::usage::ThreadUsage;
use crate::recording::RunInfo;
use crate::recording::scene::Scene;

mod fault_watch;
pub mod folder;
mod replica;
mod stream;
mod tape;

/// How often the queue is emptied, as by the log thread.
const PERIOD: Duration = Duration::from_millis(20);

/// Cycles that the queue holds \[s\]: disks were seen to stall for 25 ms, and busy ones stall for longer.
const QUEUE_S: f64 = 2.0;
/// Bound on the queue: 35 MB, all of it locked.
const MAX_QUEUE: usize = 32_768;

/// Cycles taken from the queue, or written of a window, in one step: some milliseconds.
const CYCLES_PER_STEP: usize = 2048;

/// Most windows of one run.
const MAX_WINDOWS: u32 = 100;

/// Where the recorder writes.
#[derive(Clone, Debug, Default)]
pub struct Folders {
    /// For every cycle.
    pub record: Option<PathBuf>,
    /// For the cycles around each fault.
    pub faults: Option<PathBuf>,
    /// Bounds on the sizes of the files in each.
    pub bounds: folder::Bounds,
}

impl Folders {
    /// Whether there is anything to record for.
    pub fn is_empty(&self) -> bool {
        self.record.is_none() && self.faults.is_none()
    }
}

/// Numbers of a recording over a run.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct RecorderReport {
    /// Cycles received.
    pub cycles: u64,
    /// Cycles that are missing, because a queue was full.
    pub missing: u64,
    /// Bytes written, at most.
    pub bytes: u64,
    /// Whether the replica computed every cycle as the real-time thread did.
    pub is_repeatable: bool,
    /// Of the thread.
    pub usage: ThreadUsage,
}

/// What the log thread hands over, in order.
#[expect(
    clippy::large_enum_variant,
    reason = "nearly all are cycles, and a box for each would be an allocation"
)]
pub enum Recorded {
    /// One cycle.
    Cycle(CycleMessage),
    /// Holds from the next cycle on.
    Configuration(Arc<Loaded>),
}

/// The recorder of a daemon.
pub struct Recorder {
    queue: Receiver<Recorded>,
    context: Context,
    tape: Tape,
    replica: Replica,
    recording: Option<Stream>,
    faults: Option<Folder>,
    watch: FaultWatch,
    window: Option<Stream>,
    windows: u32,
    report: RecorderReport,
}

/// What all files of a run share.
pub(super) struct Context {
    info: RunInfo,
    scene: Scene,
    /// Cycles in a second.
    rate: u64,
}

impl Recorder {
    /// Allocates all memory but that of the files; `None` if there is nothing to record for. The log thread has the other end
    /// of the queue.
    pub fn new(loaded: &Loaded, folders: &Folders) -> Option<(Self, SyncSender<Recorded>)> {
        if folders.is_empty() {
            return None;
        }
        let config = &loaded.config;
        let rate_hz = config.deployment.realtime.rate_hz;
        let (sender, queue) = sync_channel(((QUEUE_S * rate_hz) as usize).clamp(1024, MAX_QUEUE));
        let info = info(loaded);
        let context = Context { info, scene: Scene::new(&config.machine), rate: (rate_hz as u64).max(1) };
        let started_s = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |it| it.as_secs());
        let folder = |path: &PathBuf| Folder::new(path, &config.name, started_s, folders.bounds);
        let recorder = Self {
            queue,
            tape: Tape::new(rate_hz),
            replica: Replica::new(loaded.controller.clone()),
            recording: folders.record.as_ref().map(|path| Stream::recording(folder(path))),
            faults: folders.faults.as_ref().map(folder),
            watch: FaultWatch::new(context.rate),
            window: None,
            windows: 0,
            report: RecorderReport::default(),
            context,
        };
        Some((recorder, sender))
    }

    /// Runs until the log thread has ended and everything is written.
    pub fn run(mut self) -> RecorderReport {
        denormals::flush();
        let at_start = ThreadUsage::of_this_thread();
        loop {
            let (received, is_open) = self.receive();
            self.write();
            if !is_open {
                break;
            }
            if received < CYCLES_PER_STEP && self.window.is_none() {
                thread::sleep(PERIOD);
            }
        }
        self.finish();
        let usage = ThreadUsage::of_this_thread().since(&at_start);
        RecorderReport { is_repeatable: self.replica.is_in_step(), usage, ..self.report }
    }

    /// Takes cycles from the queue: how many, and whether more may come.
    fn receive(&mut self) -> (usize, bool) {
        for received in 0..CYCLES_PER_STEP {
            match self.queue.try_recv() {
                Ok(Recorded::Cycle(cycle)) => self.add(&cycle),
                Ok(Recorded::Configuration(loaded)) => self.reconfigure(&loaded),
                Err(error) => return (received, error == TryRecvError::Empty),
            }
        }
        (CYCLES_PER_STEP, true)
    }

    fn add(&mut self, cycle: &CycleMessage) {
        self.report.missing += cycle.cycle.saturating_sub(self.replica.next_cycle());
        self.report.cycles += 1;
        let is_due = self.tape.is_empty() || (cycle.cycle - 1).is_multiple_of(self.context.rate);
        let memory = if is_due { self.replica.memory_before(cycle) } else { None };
        self.tape.push(cycle, memory);
        self.replica.step(cycle);
        self.watch.add(cycle);
        if self.window.is_none()
            && let Some((code, fault)) = self.watch.due(false)
        {
            self.begin_window(code, fault);
        }
    }

    /// Goes on with another configuration, in new files: each has one, so that its replay needs no other.
    fn reconfigure(&mut self, loaded: &Loaded) {
        self.write();
        self.finish_windows();
        let RunInfo { clock_offset_ns, .. } = self.context.info;
        self.context.info = RunInfo { clock_offset_ns, ..info(loaded) };
        self.replica.reconfigure(loaded.controller.clone());
        self.tape.clear();
        if let Some(recording) = &mut self.recording
            && let Err(error) = recording.end_file()
        {
            warn!("the recording is not complete: {error}; `hexad recover` completes it");
        }
    }

    fn begin_window(&mut self, code: u32, fault: u64) {
        let Some(folder) = self.faults.as_ref().filter(|_| self.windows < MAX_WINDOWS) else { return };
        self.windows += 1;
        if self.windows == MAX_WINDOWS {
            warn!("this was fault number {MAX_WINDOWS}: the cycles of later ones are not written");
        }
        let window = Stream::window(folder, &self.context, &self.tape, code, fault);
        self.window = window.map_err(|error| warn!("the cycles around the fault are lost: {error}")).ok();
    }

    /// Writes what has been received, and some of a window.
    fn write(&mut self) {
        if let Some(recording) = &mut self.recording
            && let Err(error) = recording.advance(&self.context, &self.tape, usize::MAX)
        {
            let bytes = recording.bytes();
            self.report.bytes += bytes;
            self.recording = None;
            warn!(
                "the recording has ended: {error}; free space and restart the daemon; `hexad recover` completes the file"
            );
        }
        let Some(window) = &mut self.window else { return };
        match window.advance(&self.context, &self.tape, CYCLES_PER_STEP) {
            Ok(false) => {}
            Ok(true) => self.finish_window(),
            Err(error) => {
                warn!("the cycles around the fault are lost: {error}");
                self.window = None;
            }
        }
    }

    fn finish_window(&mut self) {
        let Some(window) = self.window.take() else { return };
        self.report.bytes += window.bytes();
        match window.finish() {
            Ok(Some(path)) => info!("the cycles around the fault are in {}", path.display()),
            Ok(None) => {}
            Err(error) => warn!("the cycles around the fault are lost: {error}"),
        }
    }

    /// Writes the windows of all faults so far.
    fn finish_windows(&mut self) {
        while self.window.is_some() {
            self.write();
        }
        if let Some((code, fault)) = self.watch.due(true) {
            self.begin_window(code, fault);
        }
        while self.window.is_some() {
            self.write();
        }
    }

    fn finish(&mut self) {
        self.finish_windows();
        if let Some(recording) = self.recording.take() {
            self.report.bytes += recording.bytes();
            match recording.finish() {
                Ok(Some(path)) => info!("the recording is in {}", path.display()),
                Ok(None) => {}
                Err(error) => warn!("the recording is not complete: {error}; `hexad recover` completes it"),
            }
        }
    }
}

fn info(Loaded { config, fidelity, .. }: &Loaded) -> RunInfo {
    let unix_ns =
        SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |it| it.as_nanos() as u64);
    RunInfo {
        name: config.name.clone(),
        version: env!("CARGO_PKG_VERSION").into(),
        commit: env!("HEXAD_COMMIT").into(),
        instruction_set: instruction_set(config),
        fidelity: fidelity.name().into(),
        configuration: config.text.clone(),
        machine: format!("{:#?}", config.machine),
        clock_offset_ns: unix_ns.wrapping_sub(monotonic_ns()),
    }
}

/// Name of the instruction set that the lanes of a machine run on.
pub fn instruction_set(config: &Config) -> String {
    let level = format!("{:?}", config.machine.level);
    level.split('(').next().unwrap_or_default().into()
}

#[cfg(test)]
mod tests;
