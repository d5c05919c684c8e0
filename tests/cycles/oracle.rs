//! The definitions a second time, as a walk over every grid point, against arbitrary delays.

use std::collections::VecDeque;

use hexad::realtime::overrun::OverrunPolicy;
use proptest::prelude::*;

use super::rig::{FIRST_NS, LATE_NS, PERIOD_NS, Script, perform};

#[derive(Debug, Default, PartialEq, Eq)]
struct Walk {
    due_ns: Vec<u64>,
    told: Vec<bool>,
    late_wakeups: u64,
    overruns: u64,
    skipped: u64,
    caught_up: u64,
}

/// The loop as one would describe it to a child: points that have come and were not run wait in a queue.
fn walk(script: &Script, most: usize, tell: bool, cycles: usize) -> Walk {
    let mut walk = Walk::default();
    let mut latencies_ns = script.latencies_ns.iter().copied().chain(std::iter::repeat(10));
    let mut burns_ns = script.burns_ns.iter().copied().chain(std::iter::repeat(100));
    let (mut now_ns, mut next_ns) = (0, FIRST_NS);
    let mut waiting = VecDeque::new();
    let mut missed = false;
    while walk.due_ns.len() < cycles {
        let waited = waiting.is_empty();
        if waited {
            now_ns = now_ns.max(next_ns + latencies_ns.next().expect("endless"));
            walk.late_wakeups += u64::from(now_ns - next_ns > LATE_NS);
            waiting.push_back(next_ns);
            next_ns += PERIOD_NS;
        }
        while next_ns <= now_ns {
            waiting.push_back(next_ns);
            next_ns += PERIOD_NS;
        }
        // The one that is run now is not among those left behind.
        while waiting.len() > most + 1 {
            waiting.pop_front();
            walk.skipped += 1;
            missed = true;
        }
        let due_ns = waiting.pop_front().expect("one is there");
        walk.caught_up += u64::from(!waited);
        walk.told.push(missed && tell);
        walk.due_ns.push(due_ns);
        let began_ns = now_ns;
        now_ns += burns_ns.next().expect("endless");
        let due_next_ns = due_ns + PERIOD_NS;
        walk.overruns += u64::from(began_ns < due_next_ns && now_ns >= due_next_ns);
        while next_ns <= now_ns {
            waiting.push_back(next_ns);
            next_ns += PERIOD_NS;
        }
        missed = !waiting.is_empty();
        while waiting.len() > most {
            waiting.pop_front();
            walk.skipped += 1;
        }
    }
    walk
}

fn delays() -> impl Strategy<Value = Vec<u64>> {
    let delay = prop_oneof![8 => 0..300_u64, 1 => 300..2500_u64, 1 => 2500..30_000_u64];
    prop::collection::vec(delay, 0..60)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn the_loop_does_what_the_definitions_say(latencies_ns in delays(), burns_ns in delays(), policy in 0..7_u64) {
        let script = Script { latencies_ns, burns_ns };
        let policy = match policy {
            0 | 1 => OverrunPolicy::Skip,
            2 => OverrunPolicy::Fault,
            most => OverrunPolicy::CatchUp { most: most - 2 },
        };
        let most = if let OverrunPolicy::CatchUp { most } = policy { most } else { 0 };
        let (seen, counters) = perform(&script, policy, 70);
        let found = Walk {
            due_ns: seen.iter().map(|cycle| cycle.due_ns).collect(),
            told: seen.iter().map(|cycle| cycle.told_of_miss).collect(),
            late_wakeups: counters.late_wakeups,
            overruns: counters.overruns,
            skipped: counters.skipped,
            caught_up: counters.caught_up,
        };
        prop_assert_eq!(found, walk(&script, most as usize, policy == OverrunPolicy::Fault, 70));
    }
}
