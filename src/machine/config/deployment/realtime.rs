//! `[realtime]`: the cycle, its release, and the threads that execute it.

use core::f64::consts::TAU;

use crate::analysis::sampled_loop::SampledLoop;
use crate::config::bound::Bound;
use crate::config::reader::SectionReader;
use hexad_client::realtime::cyclic::ReleaseMode;
use hexad_client::realtime::overrun::OverrunPolicy;
use hexad_client::realtime::setup::scheduling;
use tracing::debug;

/// Bounds of the rate \[Hz\]. At a higher rate, a wake-up takes longer than the period.
const RATE_BOUND_HZ: Bound = Bound::Within(10.0, 20_000.0);
/// Default of `late_wakeup_us`, or half a period if that is less. The wake-up latency of an ordinary kernel
/// is below it at the 99th percentile.
const DEFAULT_LATE_WAKEUP_US: f64 = 200.0;
/// Default of `max_lead_us`, or half a period if that is less. It covers the wake-up latency of an ordinary
/// kernel at the 99.9th percentile.
const DEFAULT_MAX_LEAD_US: f64 = 200.0;
/// Defaults of `io_lead_us` where a quarter of the period is longer. An I/O thread that sleeps until then wakes about
/// 50 us later and must still read in time; one that spins needs only the time for reading.
const DEFAULT_IO_LEAD_US: f64 = 100.0;
const DEFAULT_IO_LEAD_SPINNING_US: f64 = 10.0;
/// Largest number of a CPU: CPUs count from 0, and a `cpu_set_t` holds 1024.
const MAX_CPU: i32 = 1023;
/// Bounds of a `SCHED_FIFO` priority on Linux.
const PRIORITY_BOUNDS: (i32, i32) = (1, 99);
/// Largest number of cycles that `on_overrun = "catch_up"` executes at once.
const MAX_CATCH_UP: i32 = 100;
/// Largest bound of the wake-up latency for `/dev/cpu_dma_latency` \[us\]: more than any idle state needs.
const MAX_CPU_LATENCY_US: i32 = 1_000_000;

/// Section `[realtime]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Realtime {
    /// Cycles per second.
    pub rate_hz: f64,
    /// Release mode: the event that begins a cycle.
    pub release: ReleaseMode,
    /// Longest spin before a release, in the hybrid mode.
    pub max_lead_s: f64,
    /// Reaction to a cycle that has not ended at its next release.
    pub on_overrun: OverrunPolicy,
    /// Delay of a wake-up above which it counts as a missed deadline.
    pub late_wakeup_s: f64,
    /// Time before the release at which the I/O thread reads the inputs.
    pub io_lead_s: f64,
    /// CPU of the real-time thread; `None` leaves it to the scheduler.
    pub cpu: Option<usize>,
    /// CPU of the I/O thread; `None` leaves it to the scheduler.
    pub io_cpu: Option<usize>,
    /// Scheduling class of the real-time thread.
    pub scheduler: Scheduler,
    /// `SCHED_FIFO` priority of the real-time thread.
    pub priority: i32,
    /// `SCHED_FIFO` priority of the I/O thread.
    pub io_priority: i32,
    /// Whether all memory is locked.
    pub lock_memory: bool,
    /// Largest exit latency of the idle states that processors may enter \[us\].
    pub cpu_dma_latency_us: i32,
    /// Whether the daemon refuses to start if the system does not grant the above.
    pub require_realtime: bool,
}

/// Scheduling class of the real-time thread, `realtime.scheduler`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheduler {
    /// `SCHED_FIFO` at `priority`.
    Fifo,
    /// `SCHED_DEADLINE`: before every other class, with a budget per period.
    Deadline,
}

/// Time of loop and I/O in a cycle \[s\]: twice what a slow processor takes for the longest cycle that is known (2026-11-29).
const CYCLE_S: f64 = 80e-6;
/// Share that a loop gets at most: the kernel leaves 5 % to others.
const LARGEST_SHARE: f64 = 0.95;

impl Realtime {
    /// Time from one release to the next.
    pub fn period_s(&self) -> f64 {
        1.0 / self.rate_hz
    }

    /// Whether all times are times of the plant.
    pub fn is_simulated(&self) -> bool {
        self.release == ReleaseMode::Lockstep
    }

    /// Prepares the calling thread as well as permitted: a simulator or a setpoint source below the daemon's priority, so
    /// that on a busy host it is as punctual as hardware.
    pub fn prepare_peer_thread(&self) {
        scheduling::set_shortest_timer_slack();
        if let Err(shortfall) = scheduling::fifo_priority((self.io_priority - 1).max(1)) {
            debug!("{shortfall}");
        }
    }

    /// Share of a processor that loop and I/O need, with the spin before a release.
    pub fn needed_share(&self) -> f64 {
        let spin_s = if self.release == ReleaseMode::Hybrid { self.max_lead_s } else { 0.0 };
        (self.rate_hz * (CYCLE_S + spin_s)).min(LARGEST_SHARE)
    }

    /// Processors to which threads are bound; none in simulated time.
    pub fn processors(&self) -> Vec<usize> {
        let bound = [self.cpu, self.io_cpu].into_iter().flatten();
        bound.filter(|_| !self.is_simulated()).collect()
    }

    /// Longest time from a measurement to its force, in periods, of a loop without missed deadlines whose
    /// driver measures once a period: the newest message may be a period old when it is read, a lead before
    /// the release, and the force may begin at the next release. Delays of the drives are added to it.
    pub fn longest_delay(&self) -> f64 {
        match self.release {
            ReleaseMode::Sleep | ReleaseMode::Hybrid => self.longest_delay_periods_of_any_release(),
            // Released by the measurement itself.
            ReleaseMode::External | ReleaseMode::Lockstep => 1.0,
        }
    }

    /// The same for whatever releases the loop. The default limits of a machine follow from it: a simulation of the machine has
    /// the same.
    pub fn longest_delay_periods_of_any_release(&self) -> f64 {
        2.0 + self.io_lead_s * self.rate_hz
    }

    /// Part of that delay over which the estimator predicts, in periods: the age of the measurement, by its stamp.
    fn known_delay(&self) -> f64 {
        self.longest_delay() - 1.0
    }

    /// A loop with that delay, and drives that take `drive_delay_s` more.
    pub fn sampled_loop(&self, bandwidth_hz: f64, damping_ratio: f64, drive_delay_s: f64) -> SampledLoop {
        let drive = drive_delay_s * self.rate_hz;
        SampledLoop {
            wn_t: TAU * bandwidth_hz * self.period_s(),
            damping_ratio,
            known_delay_periods: self.known_delay() + drive,
            delay_periods: self.longest_delay() + drive,
            ..SampledLoop::default()
        }
    }
}

pub(super) fn read(mut section: SectionReader) -> Realtime {
    let rate_hz = section.number_or("rate_hz", 1000.0, RATE_BOUND_HZ);
    let releases = ReleaseMode::ALL.map(|release| (release.name(), release));
    let release = section.choice_or("release", ReleaseMode::Sleep, &releases);
    let io_lead_us =
        if release == ReleaseMode::Hybrid { DEFAULT_IO_LEAD_SPINNING_US } else { DEFAULT_IO_LEAD_US };
    let schedulers = [("fifo", Scheduler::Fifo), ("deadline", Scheduler::Deadline)];
    let scheduler = section.choice_or("scheduler", Scheduler::Fifo, &schedulers);
    let (low, high) = PRIORITY_BOUNDS;
    let realtime = Realtime {
        rate_hz,
        release,
        max_lead_s: within_half_period_s(&mut section, "max_lead_us", DEFAULT_MAX_LEAD_US, rate_hz),
        on_overrun: on_overrun(&mut section),
        late_wakeup_s: within_half_period_s(&mut section, "late_wakeup_us", DEFAULT_LATE_WAKEUP_US, rate_hz),
        io_lead_s: within_half_period_s(
            &mut section,
            "io_lead_us",
            io_lead_us.min(0.25e6 / rate_hz),
            rate_hz,
        ),
        cpu: cpu(&mut section, "cpu"),
        io_cpu: cpu(&mut section, "io_cpu"),
        scheduler,
        priority: section.integer_or("priority", 80, low, high),
        io_priority: section.integer_or("io_priority", 79, low, high),
        lock_memory: section.flag_or("lock_memory", true),
        cpu_dma_latency_us: section.integer_or("cpu_dma_latency_us", 0, 0, MAX_CPU_LATENCY_US),
        require_realtime: section.flag_or("require_realtime", false),
    };
    if realtime.scheduler == Scheduler::Deadline && realtime.cpu.is_some() {
        section.reject(
            "cpu",
            "must not be given with realtime.scheduler = \"deadline\" (Linux places such threads itself)",
        );
    }
    if realtime.release == ReleaseMode::External
        && matches!(realtime.on_overrun, OverrunPolicy::CatchUp { .. })
    {
        section.reject(
            "on_overrun",
            "must be one of \"skip\", \"fault\" with realtime.release = \"external\" (only the newest message is kept)",
        );
    }
    if realtime.release == ReleaseMode::Lockstep && realtime.require_realtime {
        section.reject(
            "require_realtime",
            "must be false with realtime.release = \"lockstep\" (simulated time)",
        );
    }
    if realtime.release == ReleaseMode::Lockstep && realtime.on_overrun != OverrunPolicy::Skip {
        section.reject(
            "on_overrun",
            "must be \"skip\" with realtime.release = \"lockstep\" (simulated time waits for the loop)",
        );
    }
    realtime
}

/// A duration of at most half a period.
fn within_half_period_s(
    section: &mut SectionReader,
    key: &'static str,
    default_us: f64,
    rate_hz: f64,
) -> f64 {
    let half_us = 0.5e6 / rate_hz;
    let duration_us = section.number_or(key, default_us.min(half_us), Bound::Positive);
    if duration_us > half_us {
        section.reject(
            key,
            format!("must be at most {half_us} (half a period of realtime.rate_hz = {rate_hz})"),
        );
        return f64::NAN;
    }
    duration_us / 1e6
}

fn on_overrun(section: &mut SectionReader) -> OverrunPolicy {
    let most = section.integer_or("max_catch_up", 4, 1, MAX_CATCH_UP);
    let catch_up = OverrunPolicy::CatchUp { most: u64::try_from(most).unwrap_or_default() };
    let policies = [("skip", OverrunPolicy::Skip), ("catch_up", catch_up), ("fault", OverrunPolicy::Fault)];
    section.choice_or("on_overrun", OverrunPolicy::Skip, &policies)
}

fn cpu(section: &mut SectionReader, key: &'static str) -> Option<usize> {
    section.integer(key, 0, MAX_CPU).and_then(|cpu| usize::try_from(cpu).ok())
}
