//! A cycle per measured message: the message is the clock, and silence is noticed.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use heapless::spsc::Queue;
use hexad::control::controller::{Input, Measurement, Output};
use hexad::daemon::cycle::{CycleInput, CycleRecord, IoSide};
use hexad::messages::clock::monotonic_ns;
use hexad::realtime::clock::Monotonic;
use hexad::realtime::cyclic::{LoopReport, RECORDS, ReleaseMode, Timing, run};
use hexad::realtime::exchange::exchange;
use hexad::realtime::overrun::OverrunPolicy;

/// A drive's clock has nothing to do with ours.
const DRIVE_BEGAN_NS: u64 = 5_000;
const DRIVE_PERIOD_NS: u64 = 1_000_000;

fn message(number: u64) -> CycleInput {
    let mut handed = CycleInput { measurements: number, handed_ns: monotonic_ns(), ..CycleInput::default() };
    let time_ns = DRIVE_BEGAN_NS + number * DRIVE_PERIOD_NS;
    handed.input.measurement = Some(Measurement { time_ns, ..Measurement::default() });
    handed
}

/// How soon the loop has to answer: many times its timeout.
const PATIENCE: Duration = Duration::from_secs(5);
const TIMEOUT_NS: u64 = 200_000_000;

/// The loop on a thread of its own, which a test that fails leaves behind.
struct Loop {
    io: IoSide,
    stop: Arc<AtomicBool>,
    running: JoinHandle<Ended>,
}

/// What the loop leaves behind.
struct Ended {
    report: LoopReport,
    /// Release and deadline miss that each cycle was given.
    seen: Vec<(u64, bool)>,
    records: Vec<CycleRecord>,
}

impl Loop {
    fn start() -> Self {
        let (side, io) = exchange();
        let stop = Arc::new(AtomicBool::new(false));
        let timing = Timing {
            period_ns: DRIVE_PERIOD_NS,
            phase_ns: 0,
            release: ReleaseMode::External,
            max_lead_ns: 0,
            timeout_ns: TIMEOUT_NS,
            on_overrun: OverrunPolicy::Fault,
            late_wakeup_ns: TIMEOUT_NS / 2,
        };
        let stopped = stop.clone();
        let running = spawn(move || {
            let mut queue = Queue::<CycleRecord, RECORDS>::new();
            let (records_in, mut records) = queue.split();
            let mut seen = vec![];
            let step = |input: &mut Input, _: u64| {
                seen.push((input.release_ns, input.deadline_missed));
                Output::default()
            };
            let report = run(&mut Monotonic, &timing, step, Output::default(), side, records_in, &stopped);
            let records = std::iter::from_fn(|| records.dequeue()).collect();
            Ended { report, seen, records }
        });
        Self { io, stop, running }
    }

    /// Hands in this message and waits for the next cycle.
    fn cycle_after(&mut self, number: u64) {
        let due_ns = self.io.outputs.read().due_ns;
        self.io.inputs.write(message(number));
        self.io.event.signal();
        let handed = Instant::now();
        while self.io.outputs.read().due_ns == due_ns {
            assert!(handed.elapsed() < PATIENCE, "no cycle after message {number}");
            sleep(Duration::from_micros(20));
        }
    }

    fn stop(self) -> Ended {
        self.stop.store(true, Ordering::Relaxed);
        self.io.event.signal();
        let stopped = Instant::now();
        while !self.running.is_finished() {
            assert!(stopped.elapsed() < PATIENCE, "the loop does not end");
            sleep(Duration::from_micros(20));
        }
        self.running.join().expect("the loop")
    }
}

#[test]
fn each_message_releases_one_cycle_and_silence_one_per_timeout() {
    let mut cycles = Loop::start();
    // Three before the first cycle are one release; then one by one; then three at once.
    (3..=20).for_each(|number| cycles.cycle_after(number));
    cycles.cycle_after(24);
    // Silence: cycles at the timeout, on the last of the drive's times and on.
    sleep(Duration::from_millis(500));
    cycles.cycle_after(25);
    let Ended { report, seen, records } = cycles.stop();
    let drive = |number: u64| DRIVE_BEGAN_NS + number * DRIVE_PERIOD_NS;
    let by_message: Vec<_> = (3..=20).chain([24]).map(drive).collect();
    let found: Vec<_> = seen.iter().map(|(release_ns, _)| *release_ns).collect();
    let (signalled, after) = found.split_at(by_message.len());
    assert_eq!(signalled, by_message, "the times of the drive, one cycle each");
    let (last, watchdog) = after.split_last().expect("the last message");
    assert_eq!(*last, drive(25));
    assert!((1..=3).contains(&watchdog.len()), "{watchdog:?}");
    assert!(watchdog.iter().all(|release_ns| *release_ns >= drive(24) + TIMEOUT_NS), "{watchdog:?}");
    assert_eq!(report.counters.skipped, 3, "21, 22, 23");
    // A sleep that no signal ends is as long as the timeout; a host that takes the processor away does so rarely.
    assert!(report.counters.late_wakeups < 5, "{:?}", report.counters);
    assert!(seen[by_message.len() - 1].1, "the cycle after them is told");
    let io_late = records.iter().filter(|record| record.io_late).count();
    assert_eq!(io_late, watchdog.len(), "only the cycles of the watchdog had nothing new");
}
