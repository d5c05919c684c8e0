//! A participant that only listens, and keeps everything.

use std::ops::RangeBounds;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, mpsc};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, PortError, RejectionCounts, Subscriber};
use hexad::messages::{ForceMessage, MeasuredMessage, Message, SetpointMessage, StatusMessage};
use hexad::realtime::setup::scheduling;

use super::children::HANG;
use super::trio::fastest;

/// The topics hold 256 ms at 1 kHz.
const POLL: Duration = Duration::from_millis(1);

/// What [`Recorder::cut`] keeps of the answers: longer than any rule looks back. Of what they answer it keeps
/// twice as much \[ns\].
const OVERLAP_NS: u64 = 1_000_000_000;

/// Everything that was said, in order.
#[derive(Clone, Default)]
pub struct Recording {
    pub setpoints: Vec<SetpointMessage>,
    pub measured: Vec<MeasuredMessage>,
    pub forces: Vec<ForceMessage>,
    pub statuses: Vec<StatusMessage>,
    /// Request words of every operator, as the status answers them.
    pub requests: Vec<u64>,
    /// Forces that were said and are not here.
    pub passed_over: RejectionCounts,
}

impl Recording {
    /// The platform must have stood between two instants, under control or not.
    pub fn stands(&self, (from_ns, to_ns): (u64, u64)) {
        let during = self.measured.iter().filter(|it| (from_ns..to_ns).contains(&it.header.time_ns));
        let speed = during.map(fastest).fold(0.0, f64::max);
        assert!(speed < 1e-3, "a leg moves at {speed} m/s while the platform is to stand");
    }

    pub fn has_no_fault(&self) {
        assert!(self.forces.iter().all(|force| force.state != State::Fault as u32), "no fault");
    }

    /// Longest silence that ended within this time, of daemon, plant or setpoint source \[ns\].
    pub fn longest_silence_ns(&self, within_ns: impl RangeBounds<u64>) -> u64 {
        let times: [Vec<u64>; 3] = [
            self.forces.iter().map(|message| message.header.time_ns).collect(),
            self.measured.iter().map(|message| message.header.time_ns).collect(),
            self.setpoints.iter().map(|message| message.header.time_ns).collect(),
        ];
        let gaps =
            times.iter().flat_map(|times| times.windows(2)).filter(|pair| within_ns.contains(&pair[1]));
        gaps.map(|pair| pair[1].saturating_sub(pair[0])).max().unwrap_or(0)
    }
}

/// Listens in a thread of its own, which owns the ports.
pub struct Recorder {
    recording: Arc<Mutex<Recording>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Recorder {
    /// Returns when every port is open.
    pub fn start(machine: &str) -> Self {
        Self::start_with(machine, Bus::join)
    }

    /// In simulated time.
    pub fn start_simulated(machine: &str) -> Self {
        Self::start_with(machine, Bus::join_simulated)
    }

    fn start_with(machine: &str, join: fn(&str) -> Result<Bus, PortError>) -> Self {
        let recording = Arc::new(Mutex::new(Recording::default()));
        let stop = Arc::new(AtomicBool::new(false));
        let (ready, opened) = mpsc::channel();
        let thread = {
            let (recording, stop, machine) = (recording.clone(), stop.clone(), machine.to_owned());
            spawn(move || {
                // So that a busy machine does not keep it from listening for a quarter of a second.
                let _ = scheduling::fifo_priority(1);
                let bus = join(&machine).expect("to join");
                let mut listen = Listener::new(&bus);
                ready.send(()).expect("the test waits");
                while !stop.load(Ordering::Relaxed) {
                    listen.take(&mut recording.lock().expect("no panic while it was held"));
                    sleep(POLL);
                }
                listen.take(&mut recording.lock().expect("no panic while it was held"));
            })
        };
        opened.recv().expect("the ports of the recorder");
        Self { recording, stop, thread: Some(thread) }
    }

    /// What there is so far.
    pub fn so_far(&self) -> MutexGuard<'_, Recording> {
        self.recording.lock().expect("no panic while it was held")
    }

    /// Everything so far. What is older than a second or two is forgotten then, but for the requests.
    pub fn cut(&self) -> Recording {
        let mut recording = self.so_far();
        let all = recording.clone();
        let from_ns = monotonic_ns() - OVERLAP_NS;
        forget(&mut recording.setpoints, from_ns - OVERLAP_NS);
        forget(&mut recording.measured, from_ns - OVERLAP_NS);
        forget(&mut recording.forces, from_ns);
        forget(&mut recording.statuses, from_ns);
        all
    }

    /// Waits until the recording shows something.
    pub fn until<T>(&self, what: &str, shown: impl Fn(&Recording) -> Option<T>) -> T {
        let start = Instant::now();
        loop {
            let recording = self.so_far();
            if let Some(found) = shown(&recording) {
                return found;
            }
            let last = (recording.forces.last().copied(), recording.measured.last().copied());
            drop(recording);
            assert!(start.elapsed() < HANG, "it never happens that {what}; the last messages: {last:#?}");
            sleep(POLL);
        }
    }

    /// Everything.
    pub fn finish(mut self) -> Recording {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().expect("taken only here").join().expect("the recorder");
        self.so_far().clone()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

struct Listener {
    setpoints: Subscriber<SetpointMessage>,
    measured: Subscriber<MeasuredMessage>,
    forces: Subscriber<ForceMessage>,
    statuses: Subscriber<StatusMessage>,
    word: u64,
}

impl Listener {
    fn new(bus: &Bus) -> Self {
        Self { setpoints: sink(bus), measured: sink(bus), forces: sink(bus), statuses: sink(bus), word: 0 }
    }

    fn take(&mut self, recording: &mut Recording) {
        // Answers before questions: what a force was computed from is then in the recording with it.
        while let Some(status) = self.statuses.receive() {
            if status.request_sequence != self.word {
                self.word = status.request_sequence;
                recording.requests.push(self.word);
            }
            recording.statuses.push(status);
        }
        recording.forces.extend(std::iter::from_fn(|| self.forces.receive()));
        recording.measured.extend(std::iter::from_fn(|| self.measured.receive()));
        recording.setpoints.extend(std::iter::from_fn(|| self.setpoints.receive()));
        recording.passed_over = self.forces.rejections();
    }
}

fn forget<T: Message>(messages: &mut Vec<T>, until_ns: u64) {
    messages.retain(|message| message.header().time_ns >= until_ns);
}

fn sink<T: Message>(bus: &Bus) -> Subscriber<T> {
    bus.subscriber(usize::MAX).expect("to subscribe")
}
