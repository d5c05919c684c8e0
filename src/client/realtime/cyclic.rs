//! The cyclic loop of the real-time thread.
//!
//! A cycle is released by a point of an absolute grid, so that the loop cannot drift, or from outside, by a
//! measured message. Every grid point is run or counted as skipped: cycles + skipped = points passed.
//!
//! | counter | counted when |
//! | --- | --- |
//! | late wake-up | a cycle that was waited for began later after its release than the threshold |
//! | overrun | a cycle began before its next release and was still computing at it |
//! | skipped | per grid point, or with external release per message, that no cycle was run for |
//! | caught up | a cycle was run at once because its release had passed ([`OverrunPolicy::CatchUp`]) |

use core::sync::atomic::{AtomicBool, Ordering};

use heapless::spsc::Producer;
use serde::{Deserialize, Serialize};

use super::clock::{Clock, Grid};
use super::exchange::{CycleOutput, RealtimeSide};
use super::overrun::OverrunPolicy;
use super::usage::ThreadUsage;
use super::waiter::Waiter;
use crate::messages::LoopCounters;

/// Length of the queue of records to the log thread: 50 ms at 20 kHz, two periods of the log.
pub const RECORD_QUEUE_LENGTH: usize = 1024;

/// When cycles are released and which are late.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// With external release: the expected distance of two messages.
    pub period_ns: u64,
    /// Offset of the grid from the multiples of the period.
    pub phase_ns: u64,
    /// Event that begins a cycle: a point of the grid or a message.
    pub release: ReleaseMode,
    /// Hybrid: longest spin before a release.
    pub max_lead_ns: u64,
    /// External: when no message arrives for this long, a cycle is run without one, so that the loss is noticed.
    pub timeout_ns: u64,
    /// Policy after cycles whose release has passed: skip them, catch up, or report a fault.
    pub on_overrun: OverrunPolicy,
    /// A wake-up later than this after its release is a miss.
    pub late_wakeup_ns: u64,
}

impl Timing {
    /// Longest spin before a release \[ns\]; 0 unless the release is hybrid.
    pub fn spin_ns(&self) -> u64 {
        if self.release == ReleaseMode::Hybrid { self.max_lead_ns } else { 0 }
    }
}

hexad_core::named! {
    /// Release mode: what begins a cycle.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum ReleaseMode {
        /// A point of the grid, for which the thread sleeps.
        Sleep => "sleep",
        /// A point of the grid, for which the thread sleeps and then spins.
        Hybrid => "hybrid",
        /// A measured message, signalled by the I/O thread.
        External => "external",
        /// A measured message and the setpoint of its instant, in simulated time, which does not advance without messages.
        Lockstep => "lockstep",
    }
}

/// What runs in each cycle.
pub trait CyclicTask {
    /// Input of a cycle.
    type Input: Copy;
    /// Output of a cycle.
    type Output: Copy;

    /// Instant of the measured message in an input \[ns\], if there is one.
    fn measured_ns(input: &Self::Input) -> Option<u64>;

    /// Runs a cycle. It may add to the input.
    fn run_cycle(&mut self, input: &mut Self::Input, release: &Release) -> Self::Output;
}

/// Release of a cycle, for its task.
#[derive(Clone, Copy, Debug)]
pub struct Release {
    /// Instant for which the cycle is computed \[ns\].
    pub release_ns: u64,
    /// The same instant on the daemon's clock \[ns\].
    pub clock_ns: u64,
    /// Instant at which the cycle woke \[ns\].
    pub woke_ns: u64,
    /// Whether missed cycles are to be treated as a fault.
    pub deadline_missed: bool,
}

/// One cycle, for statistics and log.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleRecord<I, O> {
    /// Number of the cycle, from 1.
    pub cycle: u64,
    /// CLOCK_MONOTONIC instant at which it was due \[ns\].
    pub due_ns: u64,
    /// Release to the first instruction of the cycle \[ns\].
    pub wakeup_ns: u64,
    /// First instruction of the cycle to its output \[ns\].
    pub compute_ns: u64,
    /// The I/O thread wrote no new input since the last cycle.
    pub io_late: bool,
    /// Input that the cycle used.
    pub input: I,
    /// Output that the cycle computed.
    pub output: O,
}

/// Resources and counters of the loop over a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoopReport {
    /// Numbers of cycles, missed deadlines and lost records since start.
    pub counters: LoopCounters,
    /// From the first release to the last cycle's end.
    pub usage: ThreadUsage,
}

/// Runs cycles until `stop`, then writes `last`, an output that is not valid.
///
/// This is the real-time path: nothing below the first release allocates, locks, logs or calls the system,
/// but for the sleep.
pub fn run<T: CyclicTask>(
    clock: &mut impl Clock,
    timing: &Timing,
    task: T,
    last: T::Output,
    side: RealtimeSide<T::Input, T::Output>,
    records: Producer<'_, CycleRecord<T::Input, T::Output>>,
    stop: &AtomicBool,
) -> LoopReport {
    let at_start = ThreadUsage::of_this_thread();
    let counters = LoopCounters::default();
    let mut cycles =
        Cycles { clock, timing, task, side, records, counters, allocations: at_start.allocations };
    let Begin { due_ns, release_ns, .. } = run_cycles(&mut cycles, stop);
    let Cycles { mut side, counters, .. } = cycles;
    let usage = ThreadUsage::of_this_thread().since(&at_start);
    side.outputs.write(CycleOutput { due_ns, release_ns, output: last, counters });
    LoopReport { counters, usage }
}

/// All cycles, in a function that the machine code has under this name: `tests/no_panic` begins here.
#[inline(never)]
fn run_cycles<C: Clock, T: CyclicTask>(cycles: &mut Cycles<'_, C, T>, stop: &AtomicBool) -> Begin {
    match cycles.timing.release {
        ReleaseMode::Sleep | ReleaseMode::Hybrid => {
            cycles.run_on_grid(Waiter::new(cycles.timing.spin_ns()), stop)
        }
        ReleaseMode::External => cycles.run_on_messages(cycles.timing.timeout_ns, stop),
        ReleaseMode::Lockstep => cycles.run_on_messages(u64::MAX, stop),
    }
}

/// The beginning of one cycle.
#[derive(Clone, Copy, Default)]
struct Begin {
    due_ns: u64,
    /// The instant it is computed for.
    release_ns: u64,
    woke_ns: u64,
    /// How much later than its release it woke. Larger than `woke_ns - due_ns` where points were skipped.
    wakeup_ns: u64,
    /// It was waited for.
    waited: bool,
    /// Points were skipped before it, or the cycle before overran.
    missed: bool,
    io_late: bool,
}

struct Cycles<'a, C, T: CyclicTask> {
    clock: &'a mut C,
    timing: &'a Timing,
    task: T,
    side: RealtimeSide<T::Input, T::Output>,
    records: Producer<'a, CycleRecord<T::Input, T::Output>>,
    counters: LoopCounters,
    /// Of this thread, before the first cycle.
    allocations: u64,
}

impl<C: Clock, T: CyclicTask> Cycles<'_, C, T> {
    fn run_on_grid(&mut self, mut waiter: Waiter, stop: &AtomicBool) -> Begin {
        let Timing { phase_ns, on_overrun, .. } = *self.timing;
        let period_ns = self.timing.period_ns.max(1);
        let mut done_ns = self.clock.now_ns();
        let mut due_ns = Grid::new(period_ns, phase_ns).next_after(done_ns);
        let mut missed = false;
        let mut begin = Begin::default();
        while !stop.load(Ordering::Relaxed) {
            let waited = due_ns > done_ns;
            let woke_ns = waiter.until(self.clock, due_ns);
            let wakeup_ns = woke_ns.saturating_sub(due_ns);
            // Held for whole periods: the ages of the inputs are judged by what time it is now.
            let skipped = on_overrun.skipped(wakeup_ns / period_ns);
            due_ns += skipped * period_ns;
            self.counters.skipped += skipped;
            missed |= skipped > 0;
            let io_late = !self.side.inputs.update();
            begin = Begin { due_ns, release_ns: due_ns, woke_ns, wakeup_ns, waited, missed, io_late };
            done_ns = self.run_one(&begin);

            let next_ns = due_ns + period_ns;
            let passed = if done_ns < next_ns { 0 } else { (done_ns - next_ns) / period_ns + 1 };
            let left_out = on_overrun.skipped(passed);
            missed = passed > 0;
            due_ns = next_ns + left_out * period_ns;
            self.counters.skipped += left_out;
        }
        begin
    }

    fn run_on_messages(&mut self, timeout_ns: u64, stop: &AtomicBool) -> Begin {
        let mut done_ns = self.clock.now_ns();
        let mut begin = Begin::default();
        let mut seen = None;
        let mut missed = false;
        loop {
            let timeout_at_ns = done_ns.saturating_add(timeout_ns);
            let signalled = self.side.event.wait(&mut self.side.inputs, self.clock, timeout_at_ns, stop);
            if stop.load(Ordering::Relaxed) {
                break;
            }
            let woke_ns = self.clock.now_ns();
            let handed = self.side.inputs.value();
            let measured_ns = T::measured_ns(&handed.input).filter(|_| signalled);
            // Those before the first cycle were not missed.
            let skipped = seen.map_or(0, |seen| handed.measurements.saturating_sub(seen + 1));
            seen = Some(handed.measurements);
            let due_ns = if signalled { handed.written_ns } else { timeout_at_ns };
            // Without a message, the drive's clock is taken to have gone on as this one did.
            let release_ns =
                measured_ns.unwrap_or_else(|| begin.release_ns + due_ns.saturating_sub(begin.due_ns));
            let wakeup_ns = woke_ns.saturating_sub(due_ns);
            missed |= skipped > 0;
            begin =
                Begin { due_ns, release_ns, woke_ns, wakeup_ns, waited: true, missed, io_late: !signalled };
            self.counters.skipped += skipped;
            done_ns = self.run_one(&begin);
            missed = done_ns >= due_ns + self.timing.period_ns;
        }
        begin
    }

    /// One cycle; returns the instant at which it was done.
    fn run_one(&mut self, begin: &Begin) -> u64 {
        let Begin { due_ns, release_ns, woke_ns, wakeup_ns, waited, missed, io_late } = *begin;
        let Timing { period_ns, on_overrun, late_wakeup_ns, .. } = *self.timing;
        let mut input = self.side.inputs.value().input;
        // Simulated time is compared with no clock.
        let clock_ns = if self.timing.release == ReleaseMode::Lockstep { release_ns } else { due_ns };
        let deadline_missed = missed && on_overrun == OverrunPolicy::Fault;
        let output =
            self.task.run_cycle(&mut input, &Release { release_ns, clock_ns, woke_ns, deadline_missed });

        let counters = &mut self.counters;
        counters.cycles += 1;
        counters.late_wakeups += u64::from(waited && wakeup_ns > late_wakeup_ns);
        counters.caught_up += u64::from(!waited);
        counters.allocations = ThreadUsage::allocator_calls_of_this_thread() - self.allocations;
        self.side.outputs.write(CycleOutput { due_ns, release_ns, output, counters: *counters });
        let done_ns = self.clock.now_ns();
        let (behind_ns, compute_ns) = (woke_ns.saturating_sub(due_ns), done_ns.saturating_sub(woke_ns));
        counters.overruns += u64::from(is_overrun(behind_ns, compute_ns, period_ns));
        let record =
            CycleRecord { cycle: counters.cycles, due_ns, wakeup_ns, compute_ns, io_late, input, output };
        counters.records_lost += u64::from(!hand_over(&mut self.records, record));
        done_ns
    }
}

/// Whether a cycle that began `behind_ns` after its release was still computing at the next one. A cycle that began later than
/// that is none: what it missed is counted as skipped or caught up.
pub fn is_overrun(behind_ns: u64, compute_ns: u64, period_ns: u64) -> bool {
    behind_ns < period_ns && behind_ns + compute_ns >= period_ns
}

/// False if the record is lost. A queue of another length than [`RECORD_QUEUE_LENGTH`] takes nothing. There is none; but a
/// queue divides by its length, and this way the compiler sees that it is not zero.
fn hand_over<T>(records: &mut Producer<'_, T>, record: T) -> bool {
    records.capacity() == RECORD_QUEUE_LENGTH - 1 && records.enqueue(record).is_ok()
}
