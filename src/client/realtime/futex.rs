//! Futex: the kernel's sleep until a number changes, and the wake-up of a thread in it.

use core::ptr::null;

use super::clock::timespec;
use super::sync::AtomicU32;

/// Wakes the thread that sleeps on `number`, if one does.
pub fn wake(number: &AtomicU32) {
    // SAFETY: the address is that of a number that outlives the call. With no thread to wake it is no failure.
    unsafe { libc::syscall(libc::SYS_futex, number, libc::FUTEX_WAKE | libc::FUTEX_PRIVATE_FLAG, 1) };
}

/// Sleeps until [`wake`] or until `instant_ns` on CLOCK_MONOTONIC, and not at all unless `number` is `expected`.
/// May end early, for a signal: the caller has to check its condition again.
///
/// A separate function, so that `tests/no_panic` can distinguish this system call from others.
#[inline(never)]
pub fn wait(number: &AtomicU32, expected: u32, instant_ns: u64) {
    let instant = timespec(instant_ns);
    // SAFETY: the addresses are those of a number and a time that outlive the call; this operation has no
    // second number.
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
