//! The log thread: turns the records of the real-time thread into statistics and into words.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

extern crate std;

use heapless::spsc::Consumer;
use std::prelude::rust_2024::*;
use std::thread;
use tracing::{info, warn};

use crate::control::state::{Cause, State};
use crate::host::report::{Fault, Times, TrackingSum};
use crate::realtime::cyclic::CycleRecord;

/// How often the queue is emptied: well before it is full at the highest rate.
const PERIOD: Duration = Duration::from_millis(20);

/// Faults kept for the report; a machine that faults more often has told enough.
const MAX_FAULTS: usize = 1000;

/// Statistics of a run.
#[derive(Debug, Default)]
pub struct LogReport {
    pub wakeup: Times,
    pub compute: Times,
    pub tracking: TrackingSum,
    pub faults: Vec<Fault>,
}

/// Runs until `stop` and until the queue is empty.
pub fn run(mut records: Consumer<'_, CycleRecord>, stop: &AtomicBool) -> LogReport {
    let mut report = LogReport::default();
    let mut last = (State::Waiting, Cause::None);
    loop {
        let stopping = stop.load(Ordering::Relaxed);
        while let Some(record) = records.dequeue() {
            report.wakeup.record(record.wakeup_ns);
            report.compute.record(record.compute_ns);
            if let Some((position, orientation)) = record.error {
                report.tracking.add(position, orientation);
            }
            let now = (record.state, record.cause);
            if now != last {
                tell(&record, last.0, &mut report.faults);
                last = now;
            }
        }
        if stopping {
            return report;
        }
        thread::sleep(PERIOD);
    }
}

fn tell(record: &CycleRecord, before: State, faults: &mut Vec<Fault>) {
    let CycleRecord { cycle, state, cause, .. } = *record;
    if state == State::Active {
        info!(cycle, "active: forces are valid");
    } else if before == State::Active && cause.is_fault() {
        warn!(cycle, number = cause as u32, "fault: {}; forces are no longer valid", cause.name());
        if faults.len() < MAX_FAULTS {
            faults.push(Fault { cycle, number: cause as u32, name: cause.name().into() });
        }
    } else {
        info!(cycle, "waiting: {}", cause.name());
    }
}
