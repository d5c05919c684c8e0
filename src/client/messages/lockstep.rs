//! Lock-step: how the participants of a machine wait for each other in simulated time.
//!
//! ```text
//! plant            measured, time_ns = t                    the clock
//! setpoint source  responds with a setpoint of time_ns = t, after its request for that cycle is posted
//! daemon           has both: one cycle; status, then force, release_ns = time_ns = t
//! plant            has the force: simulates a period, t + period
//! ```
//!
//! Each participant waits for the others, so the result does not depend on how fast any of them is: same inputs, same
//! bytes. At first a participant may not be connected: a plant that receives no response repeats its message, and the
//! source repeats its response, both with the same content. When the source has left, the daemon continues without
//! setpoints.

use core::time::Duration;
use std::thread;
use std::time::Instant;

/// Time of polling without a sleep: longer than a step of a fast plant takes, short for a person.
const BUSY_POLL_TIME: Duration = Duration::from_millis(2);

/// Sleep between two polls after that.
const POLL_INTERVAL: Duration = Duration::from_micros(100);

/// A plant repeats its message after this long without a response.
pub const REPEAT_INTERVAL: Duration = Duration::from_millis(100);

/// Polls until a value is there, or until `stop`. Other threads of this processor run in between.
pub fn poll_until<T>(stop: impl Fn() -> bool, mut poll: impl FnMut() -> Option<T>) -> Option<T> {
    let began = Instant::now();
    loop {
        if let Some(found) = poll() {
            return Some(found);
        }
        if stop() {
            return None;
        }
        if began.elapsed() < BUSY_POLL_TIME {
            thread::yield_now();
        } else {
            thread::sleep(POLL_INTERVAL);
        }
    }
}
