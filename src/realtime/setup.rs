//! What makes a process fit for real time: locked memory, FIFO priority, its own processor.
//!
//! Each step that is refused says what it lacks and how to get it; the caller decides whether to go on.

extern crate std;

use std::format;
use std::io::Error;
use std::prelude::rust_2024::*;

/// Stack touched in advance by a real-time thread: more than a cycle uses, so that no cycle meets a page
/// for the first time.
const STACK_TOUCHED: usize = 128 * 1024;

/// A step that was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {what}: {reason}; {remedy}")]
pub struct Shortfall {
    pub what: String,
    pub reason: String,
    pub remedy: &'static str,
}

fn refused(what: String, remedy: &'static str) -> Shortfall {
    Shortfall { what, reason: Error::last_os_error().to_string(), remedy }
}

/// Keeps every present and future page of the process in memory.
pub fn lock_memory() -> Result<(), Shortfall> {
    // SAFETY: takes flags only; affects where pages live, not what they hold.
    if unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } == 0 {
        return Ok(());
    }
    Err(refused("locked memory".into(), "give CAP_IPC_LOCK or LimitMEMLOCK=infinity (ulimit -l unlimited)"))
}

/// Puts the calling thread under SCHED_FIFO at this priority.
pub fn fifo_priority(priority: i32) -> Result<(), Shortfall> {
    // SAFETY: all-zero is a valid sched_param; then the one field that matters is set.
    let mut parameters: libc::sched_param = unsafe { core::mem::zeroed() };
    parameters.sched_priority = priority;
    // SAFETY: 0 means the calling thread; `parameters` is valid for the duration of the call.
    if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) } == 0 {
        return Ok(());
    }
    Err(refused(
        format!("FIFO priority {priority}"),
        "give CAP_SYS_NICE or LimitRTPRIO=99 (ulimit -r 99); in a cgroup, a real-time budget",
    ))
}

/// Binds the calling thread to one processor.
pub fn bind_to_cpu(cpu: usize) -> Result<(), Shortfall> {
    // SAFETY: all-zero is the empty set; CPU_SET ignores numbers beyond its size.
    let set = unsafe {
        let mut set: libc::cpu_set_t = core::mem::zeroed();
        libc::CPU_SET(cpu, &mut set);
        set
    };
    // SAFETY: 0 means the calling thread; the size is that of `set`.
    if unsafe { libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set) } == 0 {
        return Ok(());
    }
    Err(refused(
        format!("binding to processor {cpu}"),
        "choose one that exists and is allowed (nproc, cpuset)",
    ))
}

/// Asks for timers of the calling thread to fire within a nanosecond instead of the default 50 us. Only
/// threads without FIFO priority are affected. Cannot fail on Linux.
pub fn sharp_timers() {
    // SAFETY: plain numbers.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_usize, 0_usize, 0_usize, 0_usize) };
}

/// Touches the stack of the calling thread down to what a cycle may need.
#[inline(never)]
pub fn touch_stack() {
    let pages = [0_u8; STACK_TOUCHED];
    core::hint::black_box(&pages);
}
