//! Delays burnt on the real clock, in a thread set up as the daemon's. The host adds delays of its own, so
//! the loop is judged by the instants that the test saw itself.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use heapless::spsc::Queue;
use hexad::control::controller::Output;
use hexad::control::signals::inputs::Input;
use hexad::daemon::cycle::{CycleRecord, run};
use hexad::messages::LoopCounters;
use hexad::messages::clock::monotonic_ns;
use hexad::realtime::clock::{Clock, sleep_until};
use hexad::realtime::cyclic::{RECORD_QUEUE_LENGTH, ReleaseMode, Timing};
use hexad::realtime::exchange::exchange;
use hexad::realtime::overrun::OverrunPolicy;
use hexad::realtime::setup::scheduling;

const PERIOD_NS: u64 = 500_000;

/// Between a cycle's last instruction and the loop's look at the clock; one more miss may fall in here.
const SLACK_NS: u64 = 30_000;

const CYCLES: u64 = 1000;

/// Every fiftieth cycle burns two and a half periods.
fn burns(cycle: u64) -> bool {
    cycle.is_multiple_of(50)
}

/// CLOCK_MONOTONIC. A sleep for longer than the loop may sleep fails at once.
#[derive(Default)]
struct Watched {
    sleeps: u64,
}

impl Clock for Watched {
    fn now_ns(&mut self) -> u64 {
        monotonic_ns()
    }

    fn sleep_until(&mut self, instant_ns: u64) {
        let for_ns = instant_ns.saturating_sub(monotonic_ns());
        assert!(for_ns <= PERIOD_NS, "the loop sleeps for {for_ns} ns");
        self.sleeps += 1;
        sleep_until(instant_ns);
    }
}

/// What the test saw of a cycle.
struct Cycle {
    due_ns: u64,
    began_ns: u64,
    ended_ns: u64,
    told: bool,
}

fn perform(release: ReleaseMode, on_overrun: OverrunPolicy) -> (Vec<Cycle>, Vec<CycleRecord>, LoopCounters) {
    let (side, _io) = exchange();
    let mut queue = Queue::<CycleRecord, RECORD_QUEUE_LENGTH>::new();
    let (records_in, mut records) = queue.split();
    let stop = AtomicBool::new(false);
    let timing = Timing {
        period_ns: PERIOD_NS,
        phase_ns: 0,
        release,
        max_lead_ns: 100_000,
        timeout_ns: 0,
        on_overrun,
        late_wakeup_ns: 100_000,
    };
    let mut seen = Vec::with_capacity(CYCLES as usize);
    let step = |input: &mut Input, _: u64| {
        let began_ns = monotonic_ns();
        if burns(seen.len() as u64 + 1) {
            while monotonic_ns() < began_ns + PERIOD_NS * 5 / 2 {}
        }
        let (due_ns, told) = (input.release_ns, input.had_faulty_overrun);
        seen.push(Cycle { due_ns, began_ns, ended_ns: monotonic_ns(), told });
        stop.store(seen.len() as u64 == CYCLES, Ordering::Relaxed);
        Output::default()
    };
    let mut clock = Watched::default();
    let report = thread::scope(|threads| {
        let body = || {
            // Without it the test is slower, not wrong.
            let _ = scheduling::fifo_priority(50);
            run(&mut clock, &timing, step, Output::default(), side, records_in, &stop)
        };
        threads.spawn(body).join().expect("the loop")
    });
    assert!(clock.sleeps > CYCLES / 2, "{} sleeps in {CYCLES} cycles", clock.sleeps);
    let early = seen.iter().filter(|cycle| cycle.began_ns < cycle.due_ns).count();
    assert_eq!(early, 0, "cycles that began before their release");
    let mut written = vec![];
    written.extend(std::iter::from_fn(|| records.dequeue()));
    (seen, written, report.counters)
}

#[test]
fn burnt_time_is_counted_as_the_test_saw_it() {
    for release in [ReleaseMode::Sleep, ReleaseMode::Hybrid] {
        for policy in [OverrunPolicy::Skip, OverrunPolicy::Fault, OverrunPolicy::CatchUp { most: 3 }] {
            let (seen, records, counters) = perform(release, policy);
            let case = format!("{release:?} {policy:?}");
            assert_eq!(
                (seen.len() as u64, counters.cycles, counters.records_lost),
                (CYCLES, CYCLES, 0),
                "{case}"
            );
            every_point_is_accounted_for(&seen, &records, &counters, &case);
            for (i, pair) in seen.windows(2).enumerate() {
                let [Cycle { due_ns, ended_ns, .. }, Cycle { due_ns: next_ns, told, .. }] = *pair else {
                    unreachable!()
                };
                let late_ns = ended_ns - due_ns;
                let cycle = i as u64 + 1;
                let case = format!("{case} cycle {cycle}: ended {late_ns} ns after its release");
                if burns(cycle) && !matches!(policy, OverrunPolicy::CatchUp { .. }) {
                    assert!(records[i].compute_ns >= PERIOD_NS * 5 / 2, "{case}: {:?}", records[i]);
                    // At least the points that had passed when the test looked; more only if the loop or
                    // the sleep after it was held.
                    let passed = late_ns / PERIOD_NS;
                    let steps = (next_ns - due_ns) / PERIOD_NS;
                    let held = records[i].wakeup_ns + records[i].compute_ns > late_ns + SLACK_NS
                        || records[i + 1].wakeup_ns >= PERIOD_NS
                        || (late_ns + SLACK_NS) / PERIOD_NS > passed;
                    assert!(steps == passed + 1 || held && steps > passed, "{case}: next after {steps}");
                    assert_eq!(told, policy == OverrunPolicy::Fault, "{case}");
                }
            }
            // A cycle that began in time and ended after its next release; who was late already is not one.
            let overran = |cycle: &&Cycle| {
                let next_ns = cycle.due_ns + PERIOD_NS;
                cycle.began_ns < next_ns && cycle.ended_ns >= next_ns
            };
            let overran = seen.iter().filter(overran).count() as u64;
            let nearly =
                seen.iter().filter(|cycle| cycle.began_ns.abs_diff(cycle.due_ns + PERIOD_NS) < SLACK_NS);
            assert!(overran > CYCLES / 50 / 2, "{case}: the host left {overran} of the burnt cycles");
            assert!(counters.overruns + nearly.count() as u64 >= overran, "{case}: {overran}, {counters:?}");
        }
    }
}

/// Points passed between two cycles were skipped, each counted once, and always in phase. What is skipped
/// before the first cycle and after the last one comes on top.
fn every_point_is_accounted_for(
    seen: &[Cycle],
    records: &[CycleRecord],
    counters: &LoopCounters,
    case: &str,
) {
    assert!(seen.iter().all(|cycle| cycle.due_ns % PERIOD_NS == 0), "{case}: out of phase");
    let inside: u64 = seen.windows(2).map(|pair| (pair[1].due_ns - pair[0].due_ns) / PERIOD_NS - 1).sum();
    let last = &records[records.len() - 1];
    let outside = records[0].wakeup_ns / PERIOD_NS + (last.wakeup_ns + last.compute_ns) / PERIOD_NS;
    assert!((inside..=inside + outside).contains(&counters.skipped), "{case}: {inside} inside, {counters:?}");
}
