//! A cycle per measured message: the message is the clock, and silence is noticed.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use heapless::spsc::Queue;
use hexad::control::controller::Output;
use hexad::control::signals::inputs::{Input, Measurement};
use hexad::daemon::cycle::{CycleInput, CycleRecord, IoSide, run};
use hexad::messages::clock::monotonic_ns;
use hexad::realtime::clock::Monotonic;
use hexad::realtime::cyclic::{LoopReport, RECORD_QUEUE_LENGTH, ReleaseMode, Timing};
use hexad::realtime::exchange::exchange;
use hexad::realtime::overrun::OverrunPolicy;

/// A drive's clock has nothing to do with ours.
const DRIVE_BEGAN_NS: u64 = 5_000;
const DRIVE_PERIOD_NS: u64 = 1_000_000;

/// The time of a message, by the drive.
fn drive(number: u64) -> u64 {
    DRIVE_BEGAN_NS + number * DRIVE_PERIOD_NS
}

fn message(number: u64) -> CycleInput {
    let mut handed = CycleInput { measurements: number, written_ns: monotonic_ns(), ..CycleInput::default() };
    handed.input.measurement = Some(Measurement { time_ns: drive(number), ..Measurement::default() });
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
    /// The cycle of this message takes two periods.
    fn start(slow: Option<u64>) -> Self {
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
            let mut queue = Queue::<CycleRecord, RECORD_QUEUE_LENGTH>::new();
            let (records_in, mut records) = queue.split();
            let mut seen = vec![];
            let step = |input: &mut Input, _: u64| {
                seen.push((input.release_ns, input.had_faulty_overrun));
                if slow.is_some_and(|number| input.release_ns == drive(number)) {
                    sleep(Duration::from_nanos(2 * DRIVE_PERIOD_NS));
                }
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
    let mut cycles = Loop::start(None);
    // Three before the first cycle are one release; then one by one; then three at once.
    (3..=20).for_each(|number| cycles.cycle_after(number));
    cycles.cycle_after(24);
    // Silence: cycles at the timeout, on the last of the drive's times and on.
    sleep(Duration::from_millis(500));
    cycles.cycle_after(25);
    let Ended { report, seen, records } = cycles.stop();
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

#[test]
fn the_cycle_after_one_longer_than_a_period_is_told() {
    let mut cycles = Loop::start(Some(4));
    (3..=5).for_each(|number| cycles.cycle_after(number));
    let Ended { report, seen, .. } = cycles.stop();
    let missed = seen.iter().find(|(release_ns, _)| *release_ns == drive(5)).map(|(_, missed)| *missed);
    assert_eq!((missed, report.counters.skipped), (Some(true), 0), "{seen:?}");
}
