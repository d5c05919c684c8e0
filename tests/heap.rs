//! The heap of a thread that allocates while the loop runs: no page is met for the first time.
//!
//! Alone in its process: how the allocator serves one thread depends on all others.

#![allow(clippy::unwrap_used, reason = "a test helper that fails is a failed test")]

use std::hint::black_box;
use std::thread;

use hexad::realtime::setup::memory::{keep_heap, touch_heap};
use hexad::realtime::usage::ThreadUsage;

/// Pages of the largest block below; more than the largest that the allocator takes from its heap by itself.
const PAGES: usize = 128;
const PAGE: usize = 4096;

/// New pages that a thread met while it allocated twice, small blocks and a large one.
fn pages_met(prepare: fn()) -> u64 {
    let allocate = move || {
        prepare();
        let before = ThreadUsage::of_this_thread();
        for _ in 0..2 {
            let small: Vec<_> = (0..100).map(|_| vec![1_u8; 1000]).collect();
            black_box((small, vec![1_u8; PAGES * PAGE]));
        }
        ThreadUsage::of_this_thread().since(&before).minor_faults
    };
    thread::spawn(allocate).join().unwrap()
}

#[cfg(target_env = "gnu")]
#[test]
fn a_touched_heap_stays() {
    let untouched = pages_met(|| {});
    keep_heap();
    let touched = pages_met(touch_heap);
    assert!(untouched > PAGES as u64, "{untouched} pages without any of it");
    // Some of code that runs for the first time.
    assert!(touched < 10, "{touched} pages of a touched heap, {untouched} of another");
}
