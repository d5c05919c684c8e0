//! Waiting for the io thread, where a message and not the clock releases a cycle.
//!
//! The real-time thread sleeps in `park`: one system call, like the sleep of the grid. The io thread rings
//! by `unpark`, after it has handed in what the cycle needs.

extern crate std;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::thread::park_timeout;

use triple_buffer::Output as Reader;

use super::clock::Clock;

/// Waits until there is something new in `inputs`: true; or until `instant_ns` or `stop`: false.
pub fn wait<T: Send>(
    inputs: &mut Reader<T>,
    clock: &mut impl Clock,
    instant_ns: u64,
    stop: &AtomicBool,
) -> bool {
    loop {
        if inputs.update() {
            return true;
        }
        // A park may end for no reason.
        let left_ns = instant_ns.saturating_sub(clock.now_ns());
        if left_ns == 0 || stop.load(Ordering::Relaxed) {
            return false;
        }
        park_timeout(Duration::from_nanos(left_ns));
    }
}
