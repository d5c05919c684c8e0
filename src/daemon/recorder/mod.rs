//! The recorder thread. It keeps the last cycles in memory, and writes all cycles if configured, and those
//! around each fault.
//!
//! The log thread passes each cycle through a bounded queue. A slow disk blocks only this thread. If the
//! queue is full, cycles are lost, and the recording says so. The thread computes each cycle again in a
//! replica of the controller, so it has the controller's memory at any cycle. The real-time thread copies its
//! own memory only after cycles were lost.

use core::time::Duration;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread;
use std::time::SystemTime;

use fearless_simd::Level;
use serde::{Deserialize, Serialize};

use self::continuous::Continuous;
use self::folder::Folder;
use self::interruption::Interruption;
use self::replica::Replica;
use self::tape::Tape;
pub use self::windows::WindowOrder;
use self::windows::Windows;
use super::memory_queue::MemoryConsumer;
use super::reload::Loaded;
use crate::recording::RunInfo;
use crate::recording::scene::Scene;
use crate::version;
use hexad_client::messages::CycleMessage;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::realtime::setup::denormals;
use hexad_client::realtime::usage::ThreadUsage;

mod continuous;
mod fault_watch;
pub mod folder;
pub mod interruption;
mod replica;
mod stream;
mod tape;
mod windows;

/// Interval at which the queue is emptied, equal to the log thread's.
const PERIOD: Duration = Duration::from_millis(20);
/// The interval while a window is written, shorter because other threads must not wait for its end.
const WINDOW_PERIOD: Duration = Duration::from_millis(1);

/// Length of the queue in time \[s\]. Disks stalled for 25 ms in tests, and busy disks stall for longer.
const QUEUE_S: f64 = 2.0;
/// Largest length of the queue: 35 MB, all locked.
const MAX_QUEUE: usize = 32_768;

/// Cycles taken from the queue in one step, some milliseconds of effort.
const CYCLES_PER_STEP: usize = 2048;

/// Largest number of waiting orders of operators.
const MAX_ORDERS: usize = 4;

/// Folders of the recorder. Without a folder, cycles stay in memory.
#[derive(Clone, Debug, Default)]
pub struct Folders {
    /// Folder for every cycle.
    pub record: Option<PathBuf>,
    /// Folder for the cycles around each fault.
    pub faults: Option<PathBuf>,
    /// Bounds on the sizes of the files in each folder.
    pub bounds: folder::Bounds,
}

/// Numbers of the recorder over a run.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct RecorderReport {
    /// Cycles received.
    pub cycles: u64,
    /// Cycles lost because a queue was full.
    pub missing: u64,
    /// Cycles that were not on disk when memory had no more room for them, or when the run ended.
    pub unwritten: u64,
    /// Upper bound of the bytes written.
    pub bytes: u64,
    /// Whether the replica reproduced every cycle of the real-time thread.
    pub is_repeatable: bool,
    /// Resources of the thread.
    pub usage: ThreadUsage,
}

/// Items from the log thread, in order.
#[expect(
    clippy::large_enum_variant,
    reason = "nearly all are cycles, and a box for each would be an allocation"
)]
pub enum Recorded {
    /// One cycle.
    Cycle(CycleMessage),
    /// Configuration in force from the next cycle on.
    Configuration(Arc<Loaded>),
}

/// Ends of the queues to the recorder.
pub struct RecorderLinks {
    /// Cycles, from the log thread. If the queue is full, cycles are lost.
    pub cycles: SyncSender<Recorded>,
    /// Orders, from the control thread.
    pub orders: SyncSender<WindowOrder>,
    /// Interruption of the recording, to the control thread.
    pub interruption: Arc<Interruption>,
}

/// The recorder of a daemon.
pub struct Recorder<'a> {
    queue: Receiver<Recorded>,
    memories: MemoryConsumer<'a>,
    context: Context,
    tape: Tape,
    replica: Replica,
    /// Before this cycle, the replica does not resume from another memory of the real-time thread.
    resume_cycle: u64,
    recording: Option<Continuous>,
    windows: Windows,
    report: RecorderReport,
}

/// Values shared by all files of a run.
pub(super) struct Context {
    info: RunInfo,
    scene: Scene,
    /// Cycles per second.
    rate: u64,
}

impl Context {
    /// Whether a cycle begins a second of the run.
    fn begins_second(&self, cycle: u64) -> bool {
        cycle % self.rate == 1 % self.rate
    }
}

impl<'a> Recorder<'a> {
    /// Allocates all memory except for the files.
    pub fn new(loaded: &Loaded, memories: MemoryConsumer<'a>, folders: &Folders) -> (Self, RecorderLinks) {
        let Loaded { config, controller, .. } = loaded;
        let rate_hz = config.deployment.realtime.rate_hz;
        let (cycles, queue) = sync_channel(((QUEUE_S * rate_hz) as usize).clamp(1024, MAX_QUEUE));
        let (order_sender, orders) = sync_channel(MAX_ORDERS);
        let info = info(loaded);
        let context = Context { info, scene: Scene::new(&config.machine), rate: (rate_hz as u64).max(1) };
        let started_s = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |it| it.as_secs());
        let folder = |path: &PathBuf| Folder::new(path, &config.name, started_s, folders.bounds);
        let interruption = Arc::new(Interruption::of(folders.record.clone().unwrap_or_default()));
        let continuous = |path| Continuous::new(folder(path), interruption.clone());
        let recorder = Self {
            queue,
            memories,
            tape: Tape::new(rate_hz, controller.memory()),
            replica: Replica::new(controller.clone()),
            resume_cycle: 0,
            recording: folders.record.as_ref().map(continuous),
            windows: Windows::new(folders.faults.as_ref().map(folder), context.rate, orders),
            report: RecorderReport::default(),
            context,
        };
        (recorder, RecorderLinks { cycles, orders: order_sender, interruption })
    }

    /// Runs until the log thread has ended and everything is written.
    pub fn run(mut self) -> RecorderReport {
        denormals::flush();
        let at_start = ThreadUsage::of_this_thread();
        loop {
            let (received, is_open) = self.receive();
            if let Some(recording) = &mut self.recording {
                recording.advance(&self.context, &self.tape);
            }
            self.windows.advance(&self.context, &self.tape);
            if !is_open {
                break;
            }
            if received < CYCLES_PER_STEP {
                thread::sleep(if self.windows.is_writing() { WINDOW_PERIOD } else { PERIOD });
            }
        }
        self.windows.finish(&self.context, &self.tape);
        let (mut bytes, mut unwritten) = (self.windows.bytes, 0);
        if let Some(recording) = &mut self.recording {
            recording.finish(&self.context, &self.tape);
            bytes += recording.bytes();
            unwritten = recording.unwritten;
        }
        let usage = ThreadUsage::of_this_thread().since(&at_start);
        RecorderReport {
            bytes,
            unwritten,
            is_repeatable: self.replica.has_repeated_all(),
            usage,
            ..self.report
        }
    }

    /// Takes cycles from the queue. Returns their number, and whether more may come.
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
        self.report.missing += self.replica.skip_to(cycle.cycle);
        self.report.cycles += 1;
        let is_resumed = !self.replica.is_in_step && self.resume(cycle.cycle);
        let is_kept = is_resumed || self.tape.is_empty() || self.context.begins_second(cycle.cycle);
        self.tape.push(cycle, self.replica.memory().filter(|_| is_kept));
        self.replica.step(cycle);
        self.windows.add(&self.context, &self.tape, cycle);
    }

    /// Continues with another configuration in new files, because a file has one configuration for its
    /// replay.
    fn reconfigure(&mut self, loaded: &Loaded) {
        self.windows.finish(&self.context, &self.tape);
        if let Some(recording) = &mut self.recording {
            recording.finish(&self.context, &self.tape);
            // Earlier cycles are dropped.
            recording.unsaved_cycle = self.replica.next_cycle;
        }
        let RunInfo { clock_offset_ns, .. } = self.context.info;
        self.context.info = RunInfo { clock_offset_ns, ..info(loaded) };
        self.replica.reconfigure(loaded.controller.clone());
        self.tape.clear();
    }

    /// Resumes the replica from a memory of the real-time thread, at most once a second. Returns whether it
    /// did.
    fn resume(&mut self, cycle: u64) -> bool {
        if cycle < self.resume_cycle {
            return false;
        }
        // Removes older copies to make room for a new one.
        while self.memories.peek().is_some_and(|copy| copy.cycle < cycle) {
            let _ = self.memories.dequeue();
        }
        let Some(copy) = self.memories.peek().filter(|copy| copy.cycle == cycle) else { return false };
        self.replica.resume(&copy.memory);
        self.resume_cycle = cycle + self.context.rate;
        let _ = self.memories.dequeue();
        true
    }
}

fn info(Loaded { config, fidelity, .. }: &Loaded) -> RunInfo {
    let unix_ns =
        SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |it| it.as_nanos() as u64);
    RunInfo {
        name: config.name.clone(),
        version: version::NUMBER.into(),
        commit: version::COMMIT.into(),
        instruction_set: instruction_set(config.machine.level),
        fidelity: fidelity.name().into(),
        configuration: config.text.clone(),
        machine: format!("{:#?}", config.machine),
        clock_offset_ns: unix_ns.wrapping_sub(monotonic_ns()),
    }
}

/// Name of an instruction set in recordings.
pub fn instruction_set(level: Level) -> String {
    let level = format!("{level:?}");
    level.split('(').next().unwrap_or_default().into()
}

#[cfg(test)]
mod tests;
