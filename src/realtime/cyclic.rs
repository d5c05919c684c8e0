//! The cyclic loop of the real-time thread.
//!
//! Releases lie on an absolute grid, so that the loop cannot drift. A cycle that ends after its next
//! release leaves out the grid points it missed: a late cycle is never followed by a burst.
//!
//! | miss | counted when |
//! | --- | --- |
//! | late wake-up | the thread woke later after its release than the threshold |
//! | overrun | it woke before its next release and was still computing at it |
//! | skipped | per grid point left out, whatever the reason |

use core::sync::atomic::{AtomicBool, Ordering};

use heapless::spsc::Producer;

use super::clock::{Grid, monotonic_ns, sleep_until};
use super::usage::ThreadUsage;
use crate::control::controller::{Controller, Output};
use crate::control::state::{Cause, State};
use crate::ipc::exchange::{CycleOutput, RealtimeSide};

/// Length of the queue of records to the log thread: 50 ms at 20 kHz, twice the log's own period.
pub const RECORDS: usize = 1024;

/// When to run and what to call late.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    pub period_ns: u64,
    /// Offset of the grid from the multiples of the period.
    pub phase_ns: u64,
    /// A wake-up later than this after its release is a miss.
    pub late_wakeup_ns: u64,
}

/// Totals since start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    pub cycles: u64,
    pub late_wakeups: u64,
    pub overruns: u64,
    pub skipped: u64,
    /// Records that found the queue to the log full.
    pub records_lost: u64,
}

/// One cycle, for statistics and log.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleRecord {
    /// Number of the cycle, from 1.
    pub cycle: u64,
    pub wakeup_ns: u64,
    pub compute_ns: u64,
    pub state: State,
    pub cause: Cause,
    /// Norms of the tracking error while active \[m\], \[rad\].
    pub error: Option<(f64, f64)>,
}

/// What the loop used and counted.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoopReport {
    pub counters: Counters,
    /// From the first release to the last cycle's end.
    pub usage: ThreadUsage,
}

/// Runs cycles until `stop`, then hands out one last output that is not valid.
///
/// This is the real-time path: nothing below the first release allocates, locks, logs or calls the system,
/// but for the sleep.
pub fn run(
    timing: &Timing,
    mut controller: Controller,
    mut side: RealtimeSide,
    mut records: Producer<'_, CycleRecord>,
    stop: &AtomicBool,
) -> LoopReport {
    let grid = Grid::new(timing.period_ns, timing.phase_ns);
    let mut counters = Counters::default();
    let at_start = ThreadUsage::of_this_thread();
    let mut release_ns = grid.next_after(monotonic_ns());
    while !stop.load(Ordering::Relaxed) {
        sleep_until(release_ns);
        let woke_ns = monotonic_ns();
        let wakeup_ns = woke_ns.saturating_sub(release_ns);
        // Held for whole periods: the ages of the inputs are judged by what time it is now.
        let missed = wakeup_ns / timing.period_ns.max(1);
        release_ns += missed * timing.period_ns;
        counters.skipped += missed;
        let mut input = *side.inputs.read();
        input.release_ns = release_ns;
        let output = controller.step(&input);
        counters.cycles += 1;
        counters.late_wakeups += u64::from(wakeup_ns > timing.late_wakeup_ns);
        side.outputs.write(CycleOutput { release_ns, output, counters });
        let done_ns = monotonic_ns();
        let record = CycleRecord {
            cycle: counters.cycles,
            wakeup_ns,
            compute_ns: done_ns.saturating_sub(woke_ns),
            state: output.state,
            cause: output.cause,
            error: tracking_error(&output),
        };
        counters.records_lost += u64::from(records.enqueue(record).is_err());

        let deadline_ns = release_ns + timing.period_ns;
        counters.overruns += u64::from(woke_ns < deadline_ns && done_ns >= deadline_ns);
        release_ns = if done_ns < deadline_ns { deadline_ns } else { grid.next_after(done_ns) };
        counters.skipped += (release_ns - deadline_ns) / timing.period_ns.max(1);
    }
    let usage = ThreadUsage::of_this_thread().since(&at_start);
    let output = Output { cause: Cause::Stopping, ..Output::default() };
    side.outputs.write(CycleOutput { release_ns, output, counters });
    LoopReport { counters, usage }
}

fn tracking_error(output: &Output) -> Option<(f64, f64)> {
    let error = output.error.filter(|_| output.state == State::Active)?;
    Some((error.pose.linear.norm(), error.pose.angular.norm()))
}
