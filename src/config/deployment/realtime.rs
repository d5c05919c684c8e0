//! `[realtime]`: the cycle, its release, and the threads that run it.

use core::f64::consts::TAU;

use crate::analysis::sampled_loop::SampledLoop;
use crate::config::bound::Bound;
use crate::config::reader::Reader;
use crate::realtime::cyclic::ReleaseMode;
use crate::realtime::overrun::OverrunPolicy;

/// Slowest and fastest loop \[Hz\]. Above, one wake-up costs more than the period leaves.
const RATE_HZ: Bound = Bound::Within(10.0, 20_000.0);
/// Default of `late_wakeup_us` where half a period is longer; the wake-up latency of an ordinary kernel
/// stays below at the 99th percentile.
const LATE_WAKEUP_US: f64 = 200.0;
/// Default of `max_lead_us` where half a period is longer: covers the wake-up latency of an ordinary
/// kernel at the 99.9th percentile.
const MAX_LEAD_US: f64 = 200.0;
/// Defaults of `io_lead_us` where a quarter of the period is longer. Asleep until then, the io thread
/// wakes about 50 us later and must still read in time; awake before then, it needs only the reading.
const IO_LEAD_US: f64 = 100.0;
const IO_LEAD_AWAKE_US: f64 = 10.0;
/// CPUs count from 0; a `cpu_set_t` holds 1024.
const LAST_CPU: i32 = 1023;
/// Linux's range of `SCHED_FIFO`.
const PRIORITY: (i32, i32) = (1, 99);
/// Longest burst of `on_overrun = "catch_up"`: more is not catching up but another rate.
const MOST_CAUGHT_UP: i32 = 100;
/// Longest wake-up that `/dev/cpu_dma_latency` can be asked to allow \[us\]: more than any idle state needs.
const LONGEST_CPU_LATENCY_US: i32 = 1_000_000;

/// `[realtime]`: the cycle and its threads.
#[derive(Clone, Debug, PartialEq)]
pub struct Realtime {
    /// Cycles per second.
    pub rate_hz: f64,
    /// What begins a cycle.
    pub release: ReleaseMode,
    /// Longest spin before a release, where there is one.
    pub max_lead_s: f64,
    /// What follows a cycle that was not done at its next release.
    pub on_overrun: OverrunPolicy,
    /// A wake-up later than this after its release time counts as missed.
    pub late_wakeup_s: f64,
    /// Inputs are read this long before the release.
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
    /// Longest wake-up from an idle state that processors may choose \[us\].
    pub cpu_dma_latency_us: i32,
    /// Whether to refuse to start where the system does not grant the above.
    pub require_realtime: bool,
}

/// `realtime.scheduler`: the scheduling class of the real-time thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheduler {
    /// `SCHED_FIFO` at `priority`.
    Fifo,
    /// `SCHED_DEADLINE`: before every other class, with a budget per period.
    Deadline,
}

impl Realtime {
    /// Time from one release to the next.
    pub fn period_s(&self) -> f64 {
        1.0 / self.rate_hz
    }

    /// Whether all times are those of the plant.
    pub fn is_simulated(&self) -> bool {
        self.release == ReleaseMode::Lockstep
    }

    /// Longest time from a measurement to its force, in periods, of a loop that misses nothing and whose driver
    /// measures once a period: the newest message may be a period old when it is read, a lead before the
    /// release, and the force may come at the next release. What the drives wait or sleep comes on top.
    pub fn longest_delay(&self) -> f64 {
        match self.release {
            ReleaseMode::Sleep | ReleaseMode::Hybrid => 2.0 + self.io_lead_s * self.rate_hz,
            // Released by the measurement itself.
            ReleaseMode::External | ReleaseMode::Lockstep => 1.0,
        }
    }

    /// A loop with that delay, without observer.
    pub fn sampled_loop(&self, bandwidth_hz: f64, damping_ratio: f64) -> SampledLoop {
        SampledLoop {
            wn_t: TAU * bandwidth_hz * self.period_s(),
            damping_ratio,
            observer: 0.0,
            delay: self.longest_delay(),
            mass_ratio: 1.0,
        }
    }
}

pub(super) fn read(mut section: Reader) -> Realtime {
    let rate_hz = section.number_or("rate_hz", 1000.0, RATE_HZ);
    let releases = [
        ("sleep", ReleaseMode::Sleep),
        ("hybrid", ReleaseMode::Hybrid),
        ("external", ReleaseMode::External),
        ("lockstep", ReleaseMode::Lockstep),
    ];
    let release = section.choice_or("release", ReleaseMode::Sleep, &releases);
    let io_lead_us = if release == ReleaseMode::Hybrid { IO_LEAD_AWAKE_US } else { IO_LEAD_US };
    let schedulers = [("fifo", Scheduler::Fifo), ("deadline", Scheduler::Deadline)];
    let scheduler = section.choice_or("scheduler", Scheduler::Fifo, &schedulers);
    let (low, high) = PRIORITY;
    let realtime = Realtime {
        rate_hz,
        release,
        max_lead_s: within_half_period_s(&mut section, "max_lead_us", MAX_LEAD_US, rate_hz),
        on_overrun: on_overrun(&mut section),
        late_wakeup_s: within_half_period_s(&mut section, "late_wakeup_us", LATE_WAKEUP_US, rate_hz),
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
        cpu_dma_latency_us: section.integer_or("cpu_dma_latency_us", 0, 0, LONGEST_CPU_LATENCY_US),
        require_realtime: section.flag_or("require_realtime", false),
    };
    if realtime.scheduler == Scheduler::Deadline && realtime.cpu.is_some() {
        section.refuse(
            "cpu",
            "must not be given with realtime.scheduler = \"deadline\" (Linux places such threads itself)",
        );
    }
    if realtime.release == ReleaseMode::External
        && matches!(realtime.on_overrun, OverrunPolicy::CatchUp { .. })
    {
        section.refuse(
            "on_overrun",
            "must be one of \"skip\", \"fault\" with realtime.release = \"external\" (only the newest message is kept)",
        );
    }
    if realtime.release == ReleaseMode::Lockstep && realtime.require_realtime {
        section.refuse(
            "require_realtime",
            "must be false with realtime.release = \"lockstep\" (simulated time)",
        );
    }
    if realtime.release == ReleaseMode::Lockstep && realtime.on_overrun != OverrunPolicy::Skip {
        section.refuse(
            "on_overrun",
            "must be \"skip\" with realtime.release = \"lockstep\" (simulated time waits for the loop)",
        );
    }
    section.finish();
    realtime
}

/// A duration of at most half a period.
fn within_half_period_s(section: &mut Reader, key: &'static str, default_us: f64, rate_hz: f64) -> f64 {
    let half_us = 0.5e6 / rate_hz;
    let duration_us = section.number_or(key, default_us.min(half_us), Bound::Positive);
    if duration_us > half_us {
        section.refuse(
            key,
            format!("must be at most {half_us} (half a period of realtime.rate_hz = {rate_hz})"),
        );
        return f64::NAN;
    }
    duration_us / 1e6
}

fn on_overrun(section: &mut Reader) -> OverrunPolicy {
    let most = section.integer_or("max_catch_up", 4, 1, MOST_CAUGHT_UP);
    let catch_up = OverrunPolicy::CatchUp { most: u64::try_from(most).unwrap_or_default() };
    let policies = [("skip", OverrunPolicy::Skip), ("catch_up", catch_up), ("fault", OverrunPolicy::Fault)];
    section.choice_or("on_overrun", OverrunPolicy::Skip, &policies)
}

fn cpu(section: &mut Reader, key: &'static str) -> Option<usize> {
    section.integer(key, 0, LAST_CPU).and_then(|cpu| usize::try_from(cpu).ok())
}
