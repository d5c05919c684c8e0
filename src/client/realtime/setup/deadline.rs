//! SCHED_DEADLINE: a budget of processor time in every period, before every other class.
//!
//! The kernel's rule (CBS; sched(7), `Documentation/scheduler/sched-deadline.rst`) for a thread that sleeps
//! to the points of a grid: a wake-up after its deadline begins a new period with the full budget. One
//! shortly before it does so too, unless the thread has used up its share of the time since the last one. That holds where
//! deadline and period are equal. With a shorter deadline the kernel would delay such a wake-up until a whole period after
//! the last one, and one late cycle would make all later ones late. So the deadline is the period, and the kernel throttles
//! only a thread that has used up its budget, until its deadline. Cycles missed then are counted like any others, and the
//! kernel's signals by [`times_exhausted`].

use core::fmt::{self, Display, Formatter};
use core::sync::atomic::{AtomicU64, Ordering};

use super::refusals::SetupStep;
use super::{Shortfall, refusals};
use crate::realtime::process::handle_signal;

/// Share of a period reserved for computing: many times the usual time of a cycle, and with half a period of spinning
/// still below the 95 % that the kernel admits.
const COMPUTING_SHARE: f64 = 0.4;

/// Reservation of processor time: a budget in every period of the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reservation {
    /// Processor time per period.
    pub budget_ns: u64,
    /// Period and deadline.
    pub period_ns: u64,
}

impl Reservation {
    /// The reservation for cycles of a period, each after a spin of at most `spin_ns`.
    pub fn new(period_ns: u64, spin_ns: u64) -> Self {
        Self { budget_ns: spin_ns + (COMPUTING_SHARE * period_ns as f64) as u64, period_ns }
    }
}

impl Display for Reservation {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let [budget_us, period_us] = [self.budget_ns, self.period_ns].map(|ns| ns as f64 / 1e3);
        write!(out, "{budget_us} us of every {period_us} us")
    }
}

/// Number of SIGXCPU signals for an exhausted budget, in this process.
static BUDGET_OVERRUNS: AtomicU64 = AtomicU64::new(0);

/// Number of times that the kernel signalled an exhausted budget of a thread of this process. It signals at a timer tick
/// that finds the thread running, so this is a lower bound.
pub fn times_exhausted() -> u64 {
    BUDGET_OVERRUNS.load(Ordering::Relaxed)
}

extern "C" fn count_exhausted(_: libc::c_int) {
    BUDGET_OVERRUNS.fetch_add(1, Ordering::Relaxed);
}

/// Puts the calling thread under SCHED_DEADLINE. It cannot start threads from then on.
pub fn reserve(reservation: &Reservation) -> Result<(), Shortfall> {
    // Without a handler the signal would end the process. It cannot fail for this signal.
    // SAFETY: the handler only adds to an atomic.
    let _ = unsafe { handle_signal(libc::SIGXCPU, count_exhausted) };
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
    Err(refusals::of(&SetupStep::Deadline(*reservation)))
}
