//! Flaws that `controls` puts into the code under test.

use std::cell::Cell;
use std::thread_local;

use loom::sync::atomic::Ordering;

/// One flaw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// The code as it is.
    None,
    /// The swap of the triple buffer publishes nothing of what was written before.
    SwapWithoutRelease,
    /// The swap of the triple buffer orders nothing of what is read after.
    SwapWithoutAcquire,
    /// The count of signals publishes nothing of what was written before.
    SignalWithoutRelease,
    /// Reading the count of signals orders nothing of what is read after.
    WaitWithoutAcquire,
    /// The futex sleeps whatever the count of signals is by then.
    SleepWithoutComparison,
    /// The futex wakes nobody.
    NoWakeUp,
}

// All threads of a model run on one thread of the operating system; other tests run on others.
thread_local! {
    static PRESENT: Cell<Flaw> = const { Cell::new(Flaw::None) };
}

/// Puts a flaw into the code under test, for the models that this thread runs from here on.
pub fn set(flaw: Flaw) {
    PRESENT.set(flaw);
}

/// Whether the code under test has this flaw.
pub fn is(flaw: Flaw) -> bool {
    PRESENT.get() == flaw
}

/// `order`, unless the code has this flaw; then `weaker`.
pub fn weakened(order: Ordering, flaw: Flaw, weaker: Ordering) -> Ordering {
    if is(flaw) { weaker } else { order }
}
