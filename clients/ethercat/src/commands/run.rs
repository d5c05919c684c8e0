//! `run`: the driver of a machine.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use hexad_client::realtime::allocation::allocator_calls_of_this_thread;
use hexad_client::realtime::process::block_signals;
use hexad_client::realtime::setup::{Shortfall, memory, scheduling};
use hexad_client::realtime::stop_request::Stop;
use hexad_client::realtime::triple_buffer::{Reader, triple_buffer};
use hexad_ethercat::bus::Frames;
use hexad_ethercat::cycle::{Counts, Driver};
use hexad_ethercat::machine_check;
use hexad_ethercat::process_data::Exchange;
use hexad_ethercat::topics::Topics;
use tracing::{info, warn};

use super::bus::{leave, operational, test_brakes};
use super::{Failure, after_start, before_start, load_and_warn, load_machine, none_of};

/// Below the daemon's priorities, 80 and 79.
const PRIORITY: i32 = 70;
/// Exchanges within which one must be complete.
const FIRST_EXCHANGES: u32 = 10;
/// Cycles in which the drives stop at the end: a quick stop, and the brakes.
const END_CYCLES: u32 = 500;
/// Interval at which the counts are looked at.
const LOG_INTERVAL: Duration = Duration::from_millis(20);

pub fn run(drives: &Path, machine: &Path) -> Result<(), Failure> {
    let (file, machine) = (load_and_warn(drives)?, load_machine(machine)?);
    none_of([file.unchecked_directions(), machine_check::contradictions(&file, &machine)].concat())?;
    let stop = Stop::on_signals().map_err(before_start)?;
    memory::keep_heap();
    let report = |result: Result<(), Shortfall>| result.unwrap_or_else(|shortfall| warn!("{shortfall}"));
    report(memory::lock_all());
    scheduling::set_shortest_timer_slack();
    report(scheduling::fifo_priority(PRIORITY));
    let topics = Topics::join(&machine.name, u64::from(file.bus.answer_us) * 1000).map_err(before_start)?;
    test_brakes(&file, &machine, &stop)?.map_err(before_start)?;
    let frames = Frames::new();
    let actuator = &machine.machine.actuator;
    let middle_m = actuator.min_length_m.midpoint(actuator.max_length_m);
    let (mut bus, devices, mut data) = operational(&frames, &file, middle_m)?;
    // The first inputs; the host may lose a frame.
    let mut exchange = Exchange::Lost;
    let mut is_complete = || {
        exchange = data.next_exchange(&mut bus, &devices);
        exchange == Exchange::Complete
    };
    if !(0..FIRST_EXCHANGES).any(|_| is_complete()) {
        let cause = data.stop_cause(exchange).map(|cause| cause.to_string());
        return Err(before_start(cause.unwrap_or_else(|| "no exchange at its time".into())));
    }
    none_of(machine_check::lengths_outside(data.drives.map(|drive| drive.length_m()), &machine))?;
    for (number, drive) in (1..).zip(&data.drives).filter(|(_, drive)| drive.state().is_fault()) {
        warn!(
            "leg {number} has the fault {:#06x}: `hexad clear` or reset acknowledges it",
            drive.inputs().error_code
        );
    }
    info!(name = %machine.name, "six drives in OP");
    let mut driver = Driver::new(data, &file.bus, topics);
    let ((mut counts, shown), has_ended) = (triple_buffer(driver.counts), AtomicBool::new(false));
    let (outcome, allocations) = thread::scope(|scope| {
        scope.spawn(|| log_changes(shown, &has_ended));
        let allocations = allocator_calls_of_this_thread();
        let outcome = loop {
            let outcome = driver.cycle(&mut bus, &devices);
            counts.write(driver.counts);
            if outcome.is_err() || driver.daemon.has_failed() || stop.is_requested() {
                break outcome;
            }
        };
        driver.end();
        for _ in 0..END_CYCLES {
            if driver.cycle(&mut bus, &devices).is_err() {
                break;
            }
        }
        let allocations = allocator_calls_of_this_thread() - allocations;
        has_ended.store(true, Ordering::Relaxed);
        (outcome.map_err(after_start).and(driver.daemon.end().map_err(after_start)), allocations)
    });
    let lost_frames = driver.data.lost_frames;
    info!(counts = ?driver.counts, lost_frames, late_frames = bus.wire.unmatched_frames, allocations, "the driver ends");
    if outcome.is_ok() {
        leave(bus, devices);
    }
    outcome
}

/// Logs what the cycle counts, at ordinary priority: the cycle itself neither logs nor allocates.
fn log_changes(mut counts: Reader<Counts>, has_ended: &AtomicBool) {
    block_signals();
    scheduling::set_ordinary_policy();
    let mut logged = Counts::default();
    loop {
        let is_last = has_ended.load(Ordering::Relaxed);
        let now = *counts.read();
        if let Some(cause) = now.stop_cause.filter(|_| now.stops != logged.stops) {
            warn!("all drives are stopped: {cause}");
        }
        if now.acknowledgements != logged.acknowledgements {
            info!("the daemon has no fault: faults of drives are acknowledged");
        }
        if is_last {
            return;
        }
        logged = now;
        thread::sleep(LOG_INTERVAL);
    }
}
