//! Stack, heap and locked memory: no cycle meets a page for the first time.

use super::permissions::Permissions;
use super::refusals::SetupStep;
use super::{Shortfall, refusals};

/// Stack that a real-time thread prefaults \[bytes\]: more than a cycle uses.
const PREFAULTED_STACK_BYTES: usize = 128 * 1024;

/// Heap that the I/O thread prefaults \[bytes\]: many times its allocations while a peer connects.
const PREFAULTED_HEAP_BYTES: usize = 1024 * 1024;

/// Keeps every present and future page of the process in memory.
///
/// Refused in advance where the limit leaves no room for peers: a peer that connects later could not be served.
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

/// Makes the allocator keep its memory: freed memory is not returned to the kernel, large blocks come from the heap
/// instead of mappings of their own, and there is one heap, as each further one would reserve 64 MiB of locked memory. The
/// real-time thread never allocates, so it never waits for the heap. For the whole process, before its threads start.
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

/// Prefaults heap for the calling thread; after [`keep_heap`] its allocations up to that size cause no page fault.
pub fn prefault_heap() {
    // Not zero: for zeros the kernel would map its own zero page.
    drop(core::hint::black_box(vec![1_u8; PREFAULTED_HEAP_BYTES]));
}

/// Prefaults the stack of the calling thread down to the depth that a cycle may need.
#[inline(never)]
pub fn prefault_stack() {
    let pages = [0_u8; PREFAULTED_STACK_BYTES];
    core::hint::black_box(&pages);
}
