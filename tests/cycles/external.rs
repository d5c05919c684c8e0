//! A cycle per measured message: the message is the clock, and silence is noticed.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use heapless::spsc::Queue;
use hexad::control::controller::{Input, Measurement, Output};
use hexad::daemon::cycle::{CycleInput, CycleRecord};
use hexad::messages::clock::monotonic_ns;
use hexad::realtime::clock::Monotonic;
use hexad::realtime::cyclic::{RECORDS, ReleaseMode, Timing, run};
use hexad::realtime::exchange::exchange;
use hexad::realtime::overrun::OnOverrun;

/// A drive's clock has nothing to do with ours.
const DRIVE_BEGAN_NS: u64 = 5_000;
const DRIVE_PERIOD_NS: u64 = 1_000_000;

fn message(number: u64) -> CycleInput {
    let mut handed = CycleInput { measurements: number, handed_ns: monotonic_ns(), ..CycleInput::default() };
    let time_ns = DRIVE_BEGAN_NS + number * DRIVE_PERIOD_NS;
    handed.input.measurement = Some(Measurement { time_ns, ..Measurement::default() });
    handed
}

#[test]
fn each_message_releases_one_cycle_and_silence_one_per_timeout() {
    let (side, mut io) = exchange();
    let mut queue = Queue::<CycleRecord, RECORDS>::new();
    let (records_in, mut records) = queue.split();
    let stop = &AtomicBool::new(false);
    let timeout_ns = 200_000_000;
    let timing = Timing {
        period_ns: DRIVE_PERIOD_NS,
        phase_ns: 0,
        release: ReleaseMode::External,
        max_lead_ns: 0,
        timeout_ns,
        on_overrun: OnOverrun::Fault,
        late_wakeup_ns: 100_000_000,
    };
    let mut seen = vec![];
    let step = |input: &Input| {
        seen.push((input.release_ns, input.deadline_missed));
        Output::default()
    };
    let report = thread::scope(|threads| {
        let realtime = threads
            .spawn(move || run(&mut Monotonic, &timing, step, Output::default(), side, records_in, stop));
        let mut cycle_after = |number: u64| {
            let due_ns = io.outputs.read().due_ns;
            io.inputs.write(message(number));
            io.bell.ring();
            let asked = Instant::now();
            while io.outputs.read().due_ns == due_ns {
                assert!(asked.elapsed() < Duration::from_secs(10), "no cycle after message {number}");
                sleep(Duration::from_micros(20));
            }
        };
        // Three before the first cycle are one release; then one by one; then three at once.
        (3..=20).for_each(&mut cycle_after);
        cycle_after(24);
        // Silence: cycles at the timeout, on the last of the drive's times and on.
        sleep(Duration::from_millis(500));
        cycle_after(25);
        stop.store(true, Ordering::Relaxed);
        io.bell.ring();
        realtime.join().expect("the loop")
    });
    let drive = |number: u64| DRIVE_BEGAN_NS + number * DRIVE_PERIOD_NS;
    let by_message: Vec<_> = (3..=20).chain([24]).map(drive).collect();
    let found: Vec<_> = seen.iter().map(|(release_ns, _)| *release_ns).collect();
    let (fidelity, after) = found.split_at(by_message.len());
    assert_eq!(fidelity, by_message, "the times of the drive, one cycle each");
    let (last, watchdog) = after.split_last().expect("the last message");
    assert_eq!(*last, drive(25));
    assert!((1..=3).contains(&watchdog.len()), "{watchdog:?}");
    assert!(watchdog.iter().all(|release_ns| *release_ns >= drive(24) + timeout_ns), "{watchdog:?}");
    assert_eq!(report.counters.skipped, 3, "21, 22, 23");
    assert!(seen[by_message.len() - 1].1, "the cycle after them is told");
    let io_late = std::iter::from_fn(|| records.dequeue()).filter(|record| record.io_late).count();
    assert_eq!(io_late, watchdog.len(), "only the cycles of the watchdog had nothing new");
}
