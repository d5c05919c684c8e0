//! The heap of a thread that allocates while the loop runs: no page is met for the first time.
//!
//! Alone in its process: how the allocator serves one thread depends on all others.
#![cfg(target_env = "gnu")]
#![allow(clippy::unwrap_used, reason = "a test helper that fails is a failed test")]

use std::hint::black_box;
use std::thread;

use hexad::realtime::setup::memory::{keep_heap, prefault_heap};
use hexad::realtime::usage::ThreadUsage;

const PAGE: usize = 4096;

/// Pages that a thread met for the first time while it allocated twice, small blocks and a large one.
fn pages_met(large: usize) -> u64 {
    let allocate = move || {
        prefault_heap();
        let before = ThreadUsage::of_this_thread();
        for _ in 0..2 {
            let small: Vec<_> = (0..100).map(|_| vec![1_u8; 1000]).collect();
            black_box((small, vec![1_u8; large * PAGE]));
        }
        ThreadUsage::of_this_thread().since(&before).minor_faults
    };
    thread::spawn(allocate).join().unwrap()
}

#[test]
fn a_touched_heap_stays() {
    keep_heap();
    // Left to itself the allocator maps a block of half a MiB anew each time.
    let within = pages_met(128);
    let beyond = pages_met(1024);
    // Some are of code that runs for the first time.
    assert!(within < 10, "{within} pages of a heap that was touched");
    assert!(beyond > 512, "only {beyond} pages beyond it: the count is wrong");
}
