//! Delays burnt on the real clock, in a thread set up as the daemon's. The host adds delays of its own, so
//! the loop is judged by the instants that the test saw itself.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use heapless::spsc::Queue;
use hexad::control::controller::{Input, Output};
use hexad::ipc::exchange::exchange;
use hexad::realtime::clock::{Monotonic, monotonic_ns};
use hexad::realtime::cyclic::{Counters, CycleRecord, RECORDS, Release, Timing, run};
use hexad::realtime::overrun::OnOverrun;
use hexad::realtime::setup::scheduling;

const PERIOD_NS: u64 = 500_000;

/// Between a cycle's last instruction and the loop's look at the clock; one more miss may fall in here.
const SLACK_NS: u64 = 30_000;

const CYCLES: u64 = 1000;

/// Every fiftieth cycle burns two and a half periods.
fn burns(cycle: u64) -> bool {
    cycle.is_multiple_of(50)
}

/// Due, ended, told of a miss.
type Cycle = (u64, u64, bool);

fn perform(release: Release, on_overrun: OnOverrun) -> (Vec<Cycle>, Vec<CycleRecord>, Counters) {
    let (side, _io) = exchange();
    let mut queue = Queue::<CycleRecord, RECORDS>::new();
    let (records_in, mut records) = queue.split();
    let stop = AtomicBool::new(false);
    let timing = Timing { period_ns: PERIOD_NS, phase_ns: 0, release, on_overrun, late_wakeup_ns: 100_000 };
    let mut seen = Vec::with_capacity(CYCLES as usize);
    let step = |input: &Input| {
        let began_ns = monotonic_ns();
        if burns(seen.len() as u64 + 1) {
            while monotonic_ns() < began_ns + PERIOD_NS * 5 / 2 {}
        }
        seen.push((input.release_ns, monotonic_ns(), input.deadline_missed));
        stop.store(seen.len() as u64 == CYCLES, Ordering::Relaxed);
        Output::default()
    };
    let report = thread::scope(|threads| {
        let body = || {
            // Without it the test is slower, not wrong.
            let _ = scheduling::fifo_priority(50);
            run(&mut Monotonic, &timing, step, side, records_in, &stop)
        };
        threads.spawn(body).join().expect("the loop")
    });
    let mut written = vec![];
    written.extend(std::iter::from_fn(|| records.dequeue()));
    (seen, written, report.counters)
}

#[test]
fn burnt_time_is_counted_as_the_test_saw_it() {
    for release in [Release::Grid { max_lead_ns: 0 }, Release::Grid { max_lead_ns: 100_000 }] {
        for policy in [OnOverrun::Skip, OnOverrun::Fault, OnOverrun::CatchUp { most: 3 }] {
            let (seen, records, counters) = perform(release, policy);
            let case = format!("{release:?} {policy:?}");
            assert_eq!(
                (seen.len() as u64, counters.cycles, counters.records_lost),
                (CYCLES, CYCLES, 0),
                "{case}"
            );
            every_point_is_accounted_for(&seen, &counters, &case);
            for (i, pair) in seen.windows(2).enumerate() {
                let [(due_ns, ended_ns, _), (next_ns, _, told)] = *pair else { unreachable!() };
                let late_ns = ended_ns - due_ns;
                let cycle = i as u64 + 1;
                let case = format!("{case} cycle {cycle}: ended {late_ns} ns after its release");
                if burns(cycle) && !matches!(policy, OnOverrun::CatchUp { .. }) {
                    assert!(records[i].compute_ns >= PERIOD_NS * 5 / 2, "{case}: {:?}", records[i]);
                    // At least the points that had passed when the test looked; more only if the loop or
                    // the sleep after it was held.
                    let passed = late_ns / PERIOD_NS;
                    let steps = (next_ns - due_ns) / PERIOD_NS;
                    let held = records[i].wakeup_ns + records[i].compute_ns > late_ns + SLACK_NS
                        || records[i + 1].wakeup_ns >= PERIOD_NS
                        || (late_ns + SLACK_NS) / PERIOD_NS > passed;
                    assert!(steps == passed + 1 || held && steps > passed, "{case}: next after {steps}");
                    assert_eq!(told, policy == OnOverrun::Fault, "{case}");
                }
            }
            let burnt = CYCLES / 50;
            assert!(counters.overruns >= burnt, "{case}: {counters:?}");
        }
    }
}

/// From the first release to the last: points passed = cycles + skipped. And always in phase.
fn every_point_is_accounted_for(seen: &[Cycle], counters: &Counters, case: &str) {
    let (first_ns, last_ns) = (seen[0].0, seen[seen.len() - 1].0);
    assert!(seen.iter().all(|(due_ns, ..)| due_ns % PERIOD_NS == 0), "{case}: out of phase");
    let passed = (last_ns - first_ns) / PERIOD_NS;
    // What is skipped before the first cycle and after the last one lies outside.
    let inside: u64 = seen.windows(2).map(|pair| (pair[1].0 - pair[0].0) / PERIOD_NS - 1).sum();
    assert_eq!(passed, seen.len() as u64 - 1 + inside, "{case}");
    assert!(
        counters.skipped >= inside && counters.skipped <= inside + 3 + counters.late_wakeups,
        "{case}: {counters:?}"
    );
}
