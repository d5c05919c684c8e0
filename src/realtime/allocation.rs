//! A global allocator that counts the calls of each thread.
//!
//! The daemon itself carries it, so "the real-time thread allocates nothing" is measured in the process
//! that matters and not in a copy. The price is one increment of a thread-local number per call.

use core::alloc::{GlobalAlloc, Layout};
use core::cell::Cell;
use std::alloc::System;
use std::thread_local;

thread_local! {
    // Constant and without destructor: reaching it never allocates.
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counted.
pub struct CountingAllocator;

/// Calls of this thread to allocate, grow or free, since it began.
pub fn calls_of_this_thread() -> u64 {
    CALLS.with(Cell::get)
}

fn count() {
    // A thread being torn down has no counter any more; nobody asks for its count either.
    let _ = CALLS.try_with(|calls| calls.set(calls.get().wrapping_add(1)));
}

// SAFETY: every call is passed on unchanged to the system's allocator, which fulfils the contract;
// counting neither allocates nor unwinds.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's guarantees are those that `System` asks for.
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
