//! FIFO priority, processor and timers of the calling thread. No other thread is touched.

use core::ffi::c_int;

use super::cpus::bind;
use super::refusals::SetupStep;
use super::{Shortfall, refusals};

/// Puts the calling thread under SCHED_FIFO at this priority.
pub fn fifo_priority(priority: i32) -> Result<(), Shortfall> {
    if set_policy(libc::SCHED_FIFO, priority) {
        Ok(())
    } else {
        Err(refusals::of(&SetupStep::Fifo(priority)))
    }
}

/// Puts the calling thread back under the ordinary policy, which is always permitted.
pub fn set_ordinary_policy() {
    set_policy(libc::SCHED_OTHER, 0);
}

/// Sets the policy of the calling thread; false if it is refused.
fn set_policy(policy: c_int, priority: i32) -> bool {
    // SAFETY: all-zero is a valid sched_param; then the one field that matters is set.
    let mut parameters: libc::sched_param = unsafe { core::mem::zeroed() };
    parameters.sched_priority = priority;
    // SAFETY: 0 means the calling thread; `parameters` is valid for the duration of the call.
    unsafe { libc::sched_setscheduler(0, policy, &parameters) == 0 }
}

/// Binds the calling thread to one processor.
pub fn bind_to_cpu(cpu: usize) -> Result<(), Shortfall> {
    if bind(core::iter::once(cpu)) { Ok(()) } else { Err(refusals::of(&SetupStep::Cpu(cpu))) }
}

/// Sets the timer slack of the calling thread to a nanosecond instead of the default 50 us. Affects only
/// threads without FIFO priority. Cannot fail on Linux.
pub fn set_shortest_timer_slack() {
    // SAFETY: plain numbers.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_usize, 0_usize, 0_usize, 0_usize) };
}
