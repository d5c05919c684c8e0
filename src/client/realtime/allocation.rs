//! A global allocator that counts the calls of each thread.
//!
//! The daemon itself uses it: "the real-time thread allocates nothing" is measured in the process in production. Each
//! call costs one increment of a thread-local number.

use core::alloc::{GlobalAlloc, Layout};
use core::cell::Cell;
use std::alloc::System;
use std::thread_local;

thread_local! {
    // Constant and without destructor: reaching it never allocates.
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator with a count of its calls per thread.
pub struct CountingAllocator;

/// Calls of this thread to allocate, grow or free, since it began.
pub fn allocator_calls_of_this_thread() -> u64 {
    CALLS.with(Cell::get)
}

fn count() {
    // A thread that ends has no counter any more, and its count is no longer read.
    let _ = CALLS.try_with(|calls| calls.set(calls.get().wrapping_add(1)));
}

// SAFETY: every call is passed on unchanged to the system's allocator, which fulfils the contract;
// counting neither allocates nor unwinds.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's guarantees are those that `System` requires.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}
