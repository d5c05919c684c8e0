//! SCHED_DEADLINE: a budget of processor time in every period, before every other class.
//!
//! The kernel's rule (CBS; sched(7), `Documentation/scheduler/sched-deadline.rst`) for a thread that sleeps
//! to the points of a grid: a wake-up after its deadline begins a new period with the full budget. One
//! before it, as it comes a little earlier than the last did, does so too, unless the thread has used up
//! its share of the time since then. That holds where deadline and period are the same. With a shorter
//! deadline such a wake-up would be held until a whole period after the last one, so that one late cycle
//! would make all later ones late. So the deadline is the period, and only a thread that has used up its
//! budget is held, until its deadline. Cycles that it misses then are counted like any others, and what the
//! kernel says of it by [`times_exhausted`].

extern crate std;

use core::fmt::{self, Display, Formatter};
use core::sync::atomic::{AtomicU64, Ordering};
use std::prelude::rust_2024::*;

use super::Shortfall;
use super::refusals::{self, Step};

/// Share of a period for the computing of a cycle. Many times what it takes; and with half a period of
/// spinning before it still below the 95 % that the kernel admits.
const COMPUTING: f64 = 0.4;

/// What is asked for. The period is the cycle's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reservation {
    pub budget_ns: u64,
    pub period_ns: u64,
}

impl Reservation {
    /// For cycles of this period, each after a spin of at most `spin_ns`.
    pub fn new(period_ns: u64, spin_ns: u64) -> Self {
        Self { budget_ns: spin_ns + (COMPUTING * period_ns as f64) as u64, period_ns }
    }
}

impl Display for Reservation {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let [budget_us, period_us] = [self.budget_ns, self.period_ns].map(|ns| ns as f64 / 1e3);
        write!(out, "{budget_us} us of every {period_us} us")
    }
}

/// How often the kernel said that a budget was used up, in this process.
static EXHAUSTED: AtomicU64 = AtomicU64::new(0);

/// How often the kernel has said that the budget of a thread of this process was used up. It says so at a
/// tick of its own that finds the thread running, so this is a lower bound.
pub fn times_exhausted() -> u64 {
    EXHAUSTED.load(Ordering::Relaxed)
}

extern "C" fn count_exhausted(_: libc::c_int) {
    EXHAUSTED.fetch_add(1, Ordering::Relaxed);
}

/// Puts the calling thread under SCHED_DEADLINE. It can start no thread from then on.
pub fn reserve(reservation: &Reservation) -> Result<(), Shortfall> {
    count_exhaustions();
    let Reservation { budget_ns, period_ns } = *reservation;
    let attributes = libc::sched_attr {
        size: size_of::<libc::sched_attr>() as u32,
        sched_policy: libc::SCHED_DEADLINE as u32,
        sched_flags: libc::SCHED_FLAG_DL_OVERRUN as u64,
        sched_nice: 0,
        sched_priority: 0,
        sched_runtime: budget_ns,
        sched_deadline: period_ns,
        sched_period: period_ns,
    };
    // SAFETY: 0 means the calling thread; `attributes` says its own size and is valid for the call.
    if unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) } == 0 {
        return Ok(());
    }
    Err(refusals::of(&Step::Deadline(*reservation)))
}

/// SIGXCPU is how the kernel says it. Left alone it would end the process.
fn count_exhaustions() {
    // SAFETY: all-zero is a valid sigaction; then handler and flags are set. The handler only adds to an
    // atomic, which is allowed in one. It cannot fail for this signal.
    unsafe {
        let mut action: libc::sigaction = core::mem::zeroed();
        action.sa_sigaction = count_exhausted as extern "C" fn(libc::c_int) as libc::sighandler_t;
        // Whatever system call it hits goes on.
        action.sa_flags = libc::SA_RESTART;
        libc::sigaction(libc::SIGXCPU, &action, core::ptr::null_mut());
    }
}
