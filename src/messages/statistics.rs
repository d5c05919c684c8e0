//! Timing of the loop as the status message carries it: `#[repr(C)]`, plain numbers.

use iceoryx2::prelude::ZeroCopySend;

/// Entries of the list of worst cycles.
pub const WORST: usize = 8;

/// Distribution of a time \[ns\], from a histogram of three digits. All zero where nothing was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
#[type_name("hexad_times")]
#[repr(C)]
pub struct Times {
    pub count: u64,
    pub min: u64,
    pub mean: u64,
    pub p50: u64,
    pub p90: u64,
    pub p99: u64,
    pub p999: u64,
    pub p9999: u64,
    pub max: u64,
}

/// The times of one span.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("hexad_loop_times")]
#[repr(C)]
pub struct LoopTimes {
    /// Release to the first instruction of the cycle.
    pub wakeup_ns: Times,
    /// First instruction of the cycle to its output.
    pub compute_ns: Times,
    /// Age of the measurement at the release.
    pub measured_age_ns: Times,
    /// Release to the force sent.
    pub end_to_end_ns: Times,
}

/// One of the worst cycles since start, by wake-up and compute together, and what else happened in the
/// 20 ms around it: hints, gathered outside the real-time thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
#[type_name("hexad_worst_cycle")]
#[repr(C)]
pub struct WorstCycle {
    /// Number of the cycle, from 1; 0 where the list ends.
    pub cycle: u64,
    /// CLOCK_MONOTONIC instant at which it was due \[ns\].
    pub due_ns: u64,
    pub wakeup_ns: u64,
    pub compute_ns: u64,
    /// 1 if it ran on inputs that it had seen before.
    pub io_late: u32,
    /// Times the kernel took the processor from the real-time thread.
    pub involuntary_switches: u32,
    /// Page faults of the real-time thread.
    pub page_faults: u32,
    /// Time the host took from the processor \[ms\], to the 10 ms that Linux counts in.
    pub steal_ms: u32,
}

/// Statistics, renewed every second.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("hexad_statistics")]
#[repr(C)]
pub struct Statistics {
    /// The last whole second.
    pub window: LoopTimes,
    /// Since start.
    pub total: LoopTimes,
    /// Since start, the worst first.
    pub worst: [WorstCycle; WORST],
}
