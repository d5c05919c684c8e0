//! Lock-step: how the participants of a machine wait for each other in simulated time.
//!
//! ```text
//! plant            measured, time_ns = t                    the clock
//! setpoint source  answers with a setpoint of time_ns = t; before it, if it wants, with a request
//! daemon           has both: one cycle; status, then force, release_ns = time_ns = t
//! plant            has the force: lets a period pass, t + period
//! ```
//!
//! Nobody goes on without the others, so nothing depends on how fast anybody is: same inputs, same bytes. At
//! first no one may be there to hear a message: a plant without an answer says it again, and the source
//! answers again, both with the same content. The daemon carries on without setpoints once the source has
//! left.

use core::time::Duration;
use std::thread;
use std::time::Instant;

/// How long to look without a sleep: longer than a step of a fast plant takes, short for a person.
const AWAKE: Duration = Duration::from_millis(2);

/// Pause between two looks after that.
const POLL: Duration = Duration::from_micros(100);

/// A plant says it again after this long without an answer.
pub const REPEAT: Duration = Duration::from_millis(100);

/// Looks for something until it is there, or until `stop`. Others on this processor come first.
pub fn look_until<T>(stop: impl Fn() -> bool, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let began = Instant::now();
    loop {
        if let Some(found) = look() {
            return Some(found);
        }
        if stop() {
            return None;
        }
        if began.elapsed() < AWAKE {
            thread::yield_now();
        } else {
            thread::sleep(POLL);
        }
    }
}
