//! A loop on a clock of its own: sleeps end late and cycles take time as a script says.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

use heapless::spsc::Queue;
use hexad::control::controller::Output;
use hexad::control::signals::inputs::Input;
use hexad::daemon::cycle::{CycleRecord, run};
use hexad::messages::LoopCounters;
use hexad::realtime::clock::Clock;
use hexad::realtime::cyclic::{RECORD_QUEUE_LENGTH, ReleaseMode, Timing};
use hexad::realtime::exchange::exchange;
use hexad::realtime::overrun::OverrunPolicy;

pub const PERIOD_NS: u64 = 1000;
pub const PHASE_NS: u64 = 500;
/// The first release after time 0 that is a whole period away.
pub const FIRST_NS: u64 = PERIOD_NS + PHASE_NS;
pub const LATE_NS: u64 = 200;

/// Looks at the clock between two of its steps: one before a sleep, one after it, and some to spare.
const MAX_LOOKS: u32 = 8;

/// How late each sleep ends and how long each cycle takes; beyond the end of a list: 10 and 100.
#[derive(Clone, Debug, Default)]
pub struct Script {
    pub latencies_ns: Vec<u64>,
    pub burns_ns: Vec<u64>,
}

/// What one cycle did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    pub due_ns: u64,
    pub began_ns: u64,
    pub wakeup_ns: u64,
    pub compute_ns: u64,
    pub told_of_miss: bool,
}

/// A clock that only sleeps and cycles move. A loop that spins on it, or sleeps past its release, fails at once.
struct Scripted<'a> {
    now_ns: &'a Cell<u64>,
    latencies_ns: std::vec::IntoIter<u64>,
    /// The last look, and how many there were at that instant.
    last_ns: u64,
    looks: u32,
}

impl Clock for Scripted<'_> {
    fn now_ns(&mut self) -> u64 {
        let now_ns = self.now_ns.get();
        self.looks = if now_ns == self.last_ns { self.looks + 1 } else { 1 };
        self.last_ns = now_ns;
        assert!(self.looks <= MAX_LOOKS, "{now_ns}: the loop spins where it has to sleep");
        now_ns
    }

    fn sleep_until(&mut self, instant_ns: u64) {
        let now_ns = self.now_ns.get();
        let may_sleep = now_ns..=now_ns + PERIOD_NS + PHASE_NS;
        assert!(may_sleep.contains(&instant_ns), "{now_ns}: the loop sleeps until {instant_ns}");
        let late_ns = instant_ns + self.latencies_ns.next().unwrap_or(10);
        self.now_ns.set(now_ns.max(late_ns));
    }
}

/// Runs so many cycles from time 0 on.
pub fn perform(script: &Script, on_overrun: OverrunPolicy, cycles: usize) -> (Vec<Seen>, LoopCounters) {
    let now_ns = Cell::new(0);
    let latencies_ns = script.latencies_ns.clone().into_iter();
    let mut clock = Scripted { now_ns: &now_ns, latencies_ns, last_ns: 0, looks: 0 };
    let mut burns_ns = script.burns_ns.iter();
    let timing = Timing {
        period_ns: PERIOD_NS,
        phase_ns: PHASE_NS,
        release: ReleaseMode::Sleep,
        max_lead_ns: 0,
        timeout_ns: 0,
        on_overrun,
        late_wakeup_ns: LATE_NS,
    };
    let (side, _io) = exchange();
    let mut queue = Queue::<CycleRecord, RECORD_QUEUE_LENGTH>::new();
    let (records_in, mut records) = queue.split();
    let stop = AtomicBool::new(false);
    let mut begun: Vec<Seen> = vec![];
    let mut written: Vec<CycleRecord> = vec![];
    let step = |input: &mut Input, _: u64| {
        // The record of the cycle before; the queue never fills.
        written.extend(records.dequeue());
        let (due_ns, began_ns, told_of_miss) = (input.release_ns, now_ns.get(), input.had_faulty_overrun);
        begun.push(Seen { due_ns, began_ns, told_of_miss, wakeup_ns: 0, compute_ns: 0 });
        now_ns.set(began_ns + burns_ns.next().unwrap_or(&100));
        stop.store(begun.len() == cycles, Ordering::Relaxed);
        Output::default()
    };
    let report = run(&mut clock, &timing, step, Output::default(), side, records_in, &stop);
    written.extend(records.dequeue());
    assert_eq!(written.len(), begun.len());
    for (number, (seen, record)) in (1..).zip(begun.iter_mut().zip(&written)) {
        assert_eq!((record.cycle, record.due_ns), (number, seen.due_ns));
        (seen.wakeup_ns, seen.compute_ns) = (record.wakeup_ns, record.compute_ns);
    }
    (begun, report.counters)
}
