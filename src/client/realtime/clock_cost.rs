//! Cost of reading the clock, and of the same reading as a system call.

use crate::messages::clock::monotonic_ns;

/// ReadingErrors per measurement, so that the two that time them do not count.
const READINGS_PER_ROW: u32 = 1_000;
/// Measurements, of which the cheapest counts: others were interrupted.
const ROW_COUNT: u32 = 20;

/// Cost of reading the clock, directly and by system call.
#[derive(Clone, Copy, Debug)]
pub struct ClockCost {
    /// As the loop reads it \[ns\].
    pub reading_ns: f64,
    /// By a system call \[ns\].
    pub system_call_ns: f64,
}

impl ClockCost {
    /// Measures both, within some milliseconds.
    pub fn measure() -> Self {
        Self {
            reading_ns: cost_ns(|| _ = core::hint::black_box(monotonic_ns())),
            system_call_ns: cost_ns(call),
        }
    }
}

fn call() {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `now` is a valid timespec for the duration of the call, which is clock_gettime(2).
    unsafe { libc::syscall(libc::SYS_clock_gettime, libc::CLOCK_MONOTONIC, &raw mut now) };
}

fn cost_ns(read: impl Fn()) -> f64 {
    let row = |_| {
        let start_ns = monotonic_ns();
        (0..READINGS_PER_ROW).for_each(|_| read());
        monotonic_ns() - start_ns
    };
    (0..ROW_COUNT).map(row).min().unwrap_or_default() as f64 / f64::from(READINGS_PER_ROW)
}
