//! `release = "lockstep"`: time passes faster than in reality.

use std::fs;
use std::time::Duration;

use crate::lockstep::Build;
use crate::support::machine::PERIOD_NS;

/// Time of processors that this process and its children that have ended have used. How long they wait for a processor
/// depends on who else wants it.
fn processor_time() -> Duration {
    const TICK: Duration = Duration::from_millis(10);
    let line = fs::read_to_string("/proc/self/stat").expect("the usage of this process");
    // Behind the name: from the state on, the 12th to the 15th.
    let (_, fields) = line.rsplit_once(')').expect("the name of this process");
    fields.split_whitespace().skip(11).take(4).map(|ticks| ticks.parse::<u32>().expect("ticks") * TICK).sum()
}

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn simulated_time_is_faster_than_real_time() {
    let before = processor_time();
    let simulated = Duration::from_nanos(PERIOD_NS * Build::this(None).forces_for_us().len() as u64);
    let took = processor_time() - before;
    println!("{simulated:?} of simulated time in {took:?} of processors");
    assert!(took < simulated, "slower than real time: {took:?} for {simulated:?}");
}
