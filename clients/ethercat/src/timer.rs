//! Time of ethercrab's timers: CLOCK_MONOTONIC, or the simulated clock of a thread.

use std::cell::Cell;
use std::task::Waker;

use embassy_time_driver::{Driver, TICK_HZ};
use hexad_client::messages::clock::monotonic_ns;

const NS_PER_TICK: u64 = 1_000_000_000 / TICK_HZ;

thread_local! {
    static SIMULATED_NS: Cell<Option<u64>> = const { Cell::new(None) };
    static NEXT_WAKE_NS: Cell<u64> = const { Cell::new(u64::MAX) };
}

struct Timer;

impl Driver for Timer {
    fn now(&self) -> u64 {
        SIMULATED_NS.get().unwrap_or_else(monotonic_ns) / NS_PER_TICK
    }

    /// The thread polls by itself, so only the instant is kept.
    fn schedule_wake(&self, at: u64, _: &Waker) {
        NEXT_WAKE_NS.set(NEXT_WAKE_NS.get().min(at.saturating_mul(NS_PER_TICK)));
    }
}

embassy_time_driver::time_driver_impl!(static TIMER: Timer = Timer);

/// Sets the simulated clock of this thread.
pub(crate) fn simulate(now_ns: u64) {
    SIMULATED_NS.set(Some(now_ns));
}

/// The earliest instant for which a timer of this thread was set since the last call \[ns\].
pub(crate) fn take_next_wake_ns() -> u64 {
    NEXT_WAKE_NS.replace(u64::MAX)
}
