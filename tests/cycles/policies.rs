//! Delays of known size at known cycles, and the misses they cause, written down by hand.

use hexad::messages::LoopCounters;
use hexad::realtime::overrun::OverrunPolicy::{self, CatchUp, Fault, Skip};

use super::rig::{FIRST_NS, PERIOD_NS, PHASE_NS, Script, Seen, perform};

/// Grid points of the cycles that were run, from 0.
fn points(seen: &[Seen]) -> Vec<u64> {
    seen.iter().map(|cycle| (cycle.due_ns - FIRST_NS) / PERIOD_NS).collect()
}

fn told(seen: &[Seen]) -> Vec<usize> {
    (0..seen.len()).filter(|i| seen[*i].told_of_miss).collect()
}

/// Late wake-ups, overruns, skipped, caught up.
fn counts(counters: &LoopCounters) -> [u64; 4] {
    let LoopCounters { late_wakeups, overruns, skipped, caught_up, .. } = *counters;
    [late_wakeups, overruns, skipped, caught_up]
}

fn burn(nanoseconds: u64) -> Script {
    // The third cycle, at point 2.
    Script { burns_ns: vec![100, 100, nanoseconds], ..Script::default() }
}

fn oversleep(nanoseconds: u64) -> Script {
    Script { latencies_ns: vec![10, 10, nanoseconds], ..Script::default() }
}

/// Script, policy, points run, counts, which cycles are told of a miss.
type Case = (Script, OverrunPolicy, &'static [u64], [u64; 4], &'static [usize]);

#[test]
fn each_delay_causes_exactly_the_misses_it_should() {
    let catch_up = |most| CatchUp { most };
    let cases: Vec<Case> = vec![
        // Woken 10 ns late and done at the last moment: no miss.
        (burn(989), Skip, &[0, 1, 2, 3, 4, 5], [0, 0, 0, 0], &[]),
        (burn(989), catch_up(4), &[0, 1, 2, 3, 4, 5], [0, 0, 0, 0], &[]),
        // A nanosecond longer: the next point has passed.
        (burn(990), Skip, &[0, 1, 2, 4, 5, 6], [0, 1, 1, 0], &[]),
        (burn(990), Fault, &[0, 1, 2, 4, 5, 6], [0, 1, 1, 0], &[3]),
        (burn(990), catch_up(4), &[0, 1, 2, 3, 4, 5], [0, 1, 0, 1], &[]),
        // Two and a half periods.
        (burn(2500), Skip, &[0, 1, 2, 5, 6, 7], [0, 1, 2, 0], &[]),
        (burn(2500), Fault, &[0, 1, 2, 5, 6, 7], [0, 1, 2, 0], &[3]),
        (burn(2500), catch_up(4), &[0, 1, 2, 3, 4, 5], [0, 1, 0, 2], &[]),
        (burn(2500), catch_up(1), &[0, 1, 2, 4, 5, 6], [0, 1, 1, 1], &[]),
        // Ten periods: only the newest points are caught up.
        (burn(10_000), catch_up(2), &[0, 1, 2, 11, 12, 13], [0, 1, 8, 2], &[]),
        // Sleeps that end late: below the threshold, above it, and by whole periods.
        (oversleep(200), Skip, &[0, 1, 2, 3, 4, 5], [0, 0, 0, 0], &[]),
        (oversleep(201), Skip, &[0, 1, 2, 3, 4, 5], [1, 0, 0, 0], &[]),
        (oversleep(201), Fault, &[0, 1, 2, 3, 4, 5], [1, 0, 0, 0], &[]),
        (oversleep(3300), Skip, &[0, 1, 5, 6, 7, 8], [1, 0, 3, 0], &[]),
        (oversleep(3300), Fault, &[0, 1, 5, 6, 7, 8], [1, 0, 3, 0], &[2]),
        (oversleep(3300), catch_up(4), &[0, 1, 2, 3, 4, 5], [1, 0, 0, 3], &[]),
        (oversleep(3300), catch_up(2), &[0, 1, 3, 4, 5, 6], [1, 0, 1, 2], &[]),
        // Woken less than five points late and done after the fifth: skipped by the cycle after the late one.
        (
            Script { latencies_ns: vec![10, 10, 4950], burns_ns: vec![100; 3] },
            catch_up(4),
            &[0, 1, 2, 4, 5, 6],
            [1, 0, 1, 3],
            &[],
        ),
        // Woken late but in the period, and then computing beyond its end: both, once each.
        (
            Script { latencies_ns: vec![10, 10, 950], burns_ns: vec![100; 3] },
            Skip,
            &[0, 1, 2, 4, 5, 6],
            [1, 1, 1, 0],
            &[],
        ),
        // Too slow for good: every other point, and never a burst.
        (
            Script { burns_ns: vec![1100; 9], ..Script::default() },
            Skip,
            &[0, 2, 4, 6, 8, 10],
            [0, 6, 6, 0],
            &[],
        ),
        (
            Script { burns_ns: vec![1100; 9], ..Script::default() },
            Fault,
            &[0, 2, 4, 6, 8, 10],
            [0, 6, 6, 0],
            &[1, 2, 3, 4, 5],
        ),
    ];
    for (script, policy, run, counted, told_cycles) in cases {
        let (seen, counters) = perform(&script, policy, run.len());
        let case = format!("{script:?} {policy:?}");
        assert_eq!(points(&seen), run, "{case}");
        assert_eq!(counts(&counters), counted, "{case}");
        assert_eq!(told(&seen), told_cycles, "{case}");
        assert_eq!((counters.cycles, counters.records_lost), (run.len() as u64, 0), "{case}");
    }
}

#[test]
fn the_record_of_a_late_cycle_says_how_late_it_was() {
    let (seen, _) = perform(&oversleep(3300), Skip, 6);
    assert_eq!((seen[2].wakeup_ns, seen[2].began_ns - seen[2].due_ns), (3300, 300));
    let (seen, _) = perform(&burn(2500), Skip, 6);
    assert_eq!((seen[2].compute_ns, seen[3].wakeup_ns), (2500, 10));
    let (seen, _) = perform(&burn(2500), CatchUp { most: 4 }, 6);
    assert_eq!([seen[3].wakeup_ns, seen[4].wakeup_ns, seen[5].wakeup_ns], [1510, 610, 10]);
}

#[test]
fn a_million_cycles_do_not_drift() {
    let latencies_ns: Vec<_> = (0..1_000_000_u64).map(|k| k * 7919 % 997).collect();
    let (seen, counters) = perform(&Script { latencies_ns, burns_ns: vec![2] }, Skip, 1_000_000);
    let last = seen.last().expect("a cycle");
    assert_eq!(last.due_ns - seen[0].due_ns, (999_999 + counters.skipped) * PERIOD_NS);
    assert!(seen.iter().all(|cycle| cycle.due_ns % PERIOD_NS == PHASE_NS));
}
