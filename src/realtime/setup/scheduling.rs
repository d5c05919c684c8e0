//! FIFO priority, processor and timers of the calling thread. No other thread is touched.

use super::cpus::bind;
use super::refusals::SetupStep;
use super::{Shortfall, refusals};

/// Puts the calling thread under SCHED_FIFO at this priority.
pub fn fifo_priority(priority: i32) -> Result<(), Shortfall> {
    // SAFETY: all-zero is a valid sched_param; then the one field that matters is set.
    let mut parameters: libc::sched_param = unsafe { core::mem::zeroed() };
    parameters.sched_priority = priority;
    // SAFETY: 0 means the calling thread; `parameters` is valid for the duration of the call.
    if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) } == 0 {
        return Ok(());
    }
    Err(refusals::of(&SetupStep::Fifo(priority)))
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
