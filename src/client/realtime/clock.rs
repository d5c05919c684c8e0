//! CLOCK_MONOTONIC and the grid of releases on it.
//!
//! Every process that runs at the same rate shares the grid: its points are the multiples of the period,
//! plus a phase of the process's own. Plants and setpoint sources run on the multiples, the daemon half a
//! period later, so that it finds new data without waiting.

use crate::messages::clock::monotonic_ns;

/// Sleeps until CLOCK_MONOTONIC shows `instant_ns`; returns at once if it has passed.
pub fn sleep_until(instant_ns: u64) {
    let instant = timespec(instant_ns);
    // SAFETY: `instant` is a valid timespec for the duration of the call; a null remainder is allowed.
    // A signal ends the sleep early (EINTR): sleep on, a cycle must not begin before its release.
    while unsafe {
        libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &instant, core::ptr::null_mut())
    } == libc::EINTR
    {}
}

/// A time as system calls take it.
pub(super) fn timespec(instant_ns: u64) -> libc::timespec {
    libc::timespec {
        tv_sec: (instant_ns / 1_000_000_000) as libc::time_t,
        tv_nsec: (instant_ns % 1_000_000_000) as libc::c_long,
    }
}

/// Clock of the cyclic loop; in tests a simulated one, which makes every delay exact.
pub trait Clock {
    /// The present instant \[ns\].
    fn now_ns(&mut self) -> u64;
    /// Returns at `instant_ns` or later; at once if it has passed.
    fn sleep_until(&mut self, instant_ns: u64);
}

/// CLOCK_MONOTONIC.
#[derive(Clone, Copy, Debug)]
pub struct Monotonic;

impl Clock for Monotonic {
    fn now_ns(&mut self) -> u64 {
        monotonic_ns()
    }

    fn sleep_until(&mut self, instant_ns: u64) {
        sleep_until(instant_ns);
    }
}

/// Release grid: points in time `k * period + phase`.
///
/// ```
/// let grid = hexad_client::realtime::clock::Grid::new(1000, 500);
/// assert_eq!([grid.next_after(1499), grid.next_after(1500)], [1500, 2500]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    period_ns: u64,
    phase_ns: u64,
}

impl Grid {
    /// The grid with a `phase_ns` below `period_ns`, which is not zero.
    // Inlined into the loop, which is compiled in another crate: there the compiler sees that it divides by no zero.
    #[inline]
    pub fn new(period_ns: u64, phase_ns: u64) -> Self {
        Self { period_ns: period_ns.max(1), phase_ns }
    }

    /// Distance of neighbouring points.
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// The first point after `instant_ns`.
    pub fn next_after(&self, instant_ns: u64) -> u64 {
        let points = instant_ns.saturating_sub(self.phase_ns) / self.period_ns + 1;
        points * self.period_ns + self.phase_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_points_are_in_phase_and_strictly_later() {
        let grid = Grid::new(1000, 500);
        for (instant, next) in
            [(500, 1500), (1499, 1500), (1500, 2500), (1501, 2500), (123_456_789, 123_457_500)]
        {
            assert_eq!(grid.next_after(instant), next);
        }
    }

    #[test]
    fn sleeping_never_ends_early() {
        for _ in 0..20 {
            let instant = monotonic_ns() + 200_000;
            sleep_until(instant);
            assert!(monotonic_ns() >= instant);
        }
    }
}
