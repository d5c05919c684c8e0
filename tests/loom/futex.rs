//! In place of `src/client/realtime/futex.rs`: a futex whose sleep ends only by a wake-up.
//!
//! The lock stands for the kernel's lock of the queue of sleepers: a wake-up comes before the comparison or after
//! the sleep has begun.

use loom::sync::{Condvar, Mutex};

use crate::flaw::{self, Flaw};
use crate::sync::{AtomicU32, Ordering};

loom::lazy_static! {
    /// Addresses of the numbers that are slept on.
    static ref SLEEPERS: Mutex<Vec<usize>> = Mutex::new(vec![]);
    static ref WOKEN: Condvar = Condvar::new();
}

pub fn wake(number: &AtomicU32) {
    if flaw::is(Flaw::NoWakeUp) {
        return;
    }
    let mut sleepers = SLEEPERS.lock().unwrap();
    if let Some(index) = sleepers.iter().position(|sleeper| *sleeper == address(number)) {
        sleepers.swap_remove(index);
        WOKEN.notify_all();
    }
}

pub fn wait(number: &AtomicU32, expected: u32, _instant_ns: u64) {
    let mut sleepers = SLEEPERS.lock().unwrap();
    if number.load(Ordering::Relaxed) != expected && !flaw::is(Flaw::SleepWithoutComparison) {
        return;
    }
    sleepers.push(address(number));
    while sleepers.contains(&address(number)) {
        sleepers = WOKEN.wait(sleepers).unwrap();
    }
}

fn address(number: &AtomicU32) -> usize {
    core::ptr::from_ref(number).addr()
}
