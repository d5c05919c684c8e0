//! Waiting for the io thread, where a message and not the clock releases a cycle.
//!
//! The real-time thread sleeps on a futex: one system call, like the sleep of the grid. The io thread rings
//! after it has handed in what the cycle needs. Not `park` of the standard library: it may panic, and where
//! it has no handle of the thread yet, allocate.

use core::ptr::null;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use super::clock::{Clock, timespec};
use super::newest::Reader;

/// Rung by one thread, waited for by another.
#[derive(Debug, Default)]
pub struct Doorbell {
    /// How often it was rung.
    rings: AtomicU32,
}

impl Doorbell {
    /// Wakes who waits.
    pub fn ring(&self) {
        self.rings.fetch_add(1, Ordering::Release);
        // SAFETY: the address is that of a number that outlives the call. Nobody to wake is no failure.
        unsafe {
            libc::syscall(libc::SYS_futex, &self.rings, libc::FUTEX_WAKE | libc::FUTEX_PRIVATE_FLAG, 1)
        };
    }

    /// Waits until there is something new in `inputs`: true; or until `instant_ns` or `stop`: false. Who sets
    /// `stop` rings.
    pub fn wait<T: Copy>(
        &self,
        inputs: &mut Reader<T>,
        clock: &mut impl Clock,
        instant_ns: u64,
        stop: &AtomicBool,
    ) -> bool {
        loop {
            // Counted before looking: a ring from here on ends the sleep, or keeps it from beginning.
            let rings = self.rings.load(Ordering::Acquire);
            if inputs.update() {
                return true;
            }
            if clock.now_ns() >= instant_ns || stop.load(Ordering::Relaxed) {
                return false;
            }
            futex_wait(&self.rings, rings, instant_ns);
        }
    }
}

/// Sleeps until `instant_ns` on CLOCK_MONOTONIC unless `number` is not `expected`. May end early, for a signal.
///
/// A function of its own, so that `tests/no_panic` can tell this system call from others.
#[inline(never)]
fn futex_wait(number: &AtomicU32, expected: u32, instant_ns: u64) {
    let instant = timespec(instant_ns);
    // SAFETY: the addresses are those of a number and a time that outlive the call; this operation has no
    // second number. However it ends, the caller looks again.
    unsafe {
        libc::syscall(
            libc::SYS_futex,
            number,
            libc::FUTEX_WAIT_BITSET | libc::FUTEX_PRIVATE_FLAG,
            expected,
            &instant,
            null::<u32>(),
            libc::FUTEX_BITSET_MATCH_ANY,
        )
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::clock::monotonic_ns;
    use crate::realtime::clock::Monotonic;
    use crate::realtime::newest::newest;
    use std::thread::scope;

    /// Longer than any test may take.
    const FAR_NS: u64 = 60_000_000_000;

    #[test]
    fn without_a_ring_the_wait_ends_at_its_instant() {
        let (_writer, mut inputs) = newest(0);
        let instant_ns = monotonic_ns() + 5_000_000;
        let rung = Doorbell::default().wait(&mut inputs, &mut Monotonic, instant_ns, &AtomicBool::new(false));
        assert!(!rung && monotonic_ns() >= instant_ns);
    }

    #[test]
    fn no_ring_is_missed() {
        let (bell, answer) = (Doorbell::default(), Doorbell::default());
        let (mut writer, mut inputs) = newest(0);
        let (mut echo, mut echoed) = newest(0);
        let stop = AtomicBool::new(false);
        let far_ns = monotonic_ns() + FAR_NS;
        scope(|threads| {
            threads.spawn(|| {
                while bell.wait(&mut inputs, &mut Monotonic, far_ns, &stop) {
                    echo.write(*inputs.value());
                    answer.ring();
                }
            });
            for round in 1..10_000 {
                writer.write(round);
                bell.ring();
                assert!(
                    answer.wait(&mut echoed, &mut Monotonic, far_ns, &stop),
                    "round {round} has no answer"
                );
                assert_eq!(*echoed.value(), round);
            }
            stop.store(true, Ordering::Relaxed);
            bell.ring();
        });
        assert!(monotonic_ns() < far_ns, "the ring for the stop was missed");
    }
}
