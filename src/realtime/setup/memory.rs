//! Stack, heap and locked memory: no page is met for the first time in a cycle.

use super::permissions::Permissions;
use super::refusals::SetupStep;
use super::{Shortfall, refusals};

/// Stack touched in advance by a real-time thread: more than a cycle uses.
const PREFAULTED_STACK_BYTES: usize = 128 * 1024;

/// Heap touched in advance by a thread that allocates while a peer connects: many times what it then uses.
const PREFAULTED_HEAP_BYTES: usize = 1024 * 1024;

/// Keeps every present and future page of the process in memory.
///
/// Not tried with a limit that leaves peers no room: a peer that connected later could not be served.
pub fn lock_all() -> Result<(), Shortfall> {
    if let Some(shortfall) = Permissions::of_this_process().refusal_of(&SetupStep::LockedMemory) {
        return Err(shortfall);
    }
    // SAFETY: takes flags only; affects where pages live, not what they hold.
    if unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } == 0 {
        return Ok(());
    }
    Err(refusals::of(&SetupStep::LockedMemory))
}

/// Has the allocator keep what it once had from the kernel: freed memory is not given back, and large blocks
/// come from the heap instead of mappings of their own. And there is one heap: each further one would
/// reserve 64 MiB, all of which count as locked; the one thread that must not wait for it never allocates.
/// For the whole process, before its threads start.
#[cfg(target_env = "gnu")]
pub fn keep_heap() {
    // SAFETY: plain numbers, set under the lock of the allocator. They only decide where blocks come from.
    unsafe {
        // -1: never.
        libc::mallopt(libc::M_TRIM_THRESHOLD, -1);
        libc::mallopt(libc::M_MMAP_MAX, 0);
        libc::mallopt(libc::M_ARENA_MAX, 1);
    }
}

/// Other allocators have no such setting: a thread that allocates may meet new pages.
#[cfg(not(target_env = "gnu"))]
pub fn keep_heap() {}

/// Touches heap for the calling thread; after [`keep_heap`] its allocations up to that size meet no page
/// for the first time.
pub fn prefault_heap() {
    // Not zero: the kernel's own zero pages would do for that, untouched.
    drop(core::hint::black_box(vec![1_u8; PREFAULTED_HEAP_BYTES]));
}

/// Touches the stack of the calling thread down to what a cycle may need.
#[inline(never)]
pub fn prefault_stack() {
    let pages = [0_u8; PREFAULTED_STACK_BYTES];
    core::hint::black_box(&pages);
}
