//! Timing of the loop, a message of its own, and its counters, parts of the status message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;

/// Entries of the list of worst cycles.
pub const WORST_CYCLES: usize = 8;

message! {
    /// Distribution of a time, from a histogram of three digits. All zero where nothing was recorded.
    Times = "hexad_times" {
        /// Number of values.
        count: u64,
        min: u64 ["ns"],
        mean: u64 ["ns"],
        p50: u64 ["ns"],
        p90: u64 ["ns"],
        p99: u64 ["ns"],
        p999: u64 ["ns"],
        p9999: u64 ["ns"],
        max: u64 ["ns"],
    }
}

message! {
    /// Distributions of the times of the cycles in one span.
    LoopTimes = "hexad_loop_times" {
        /// Release to the first instruction of the cycle.
        wakeup_ns: Times,
        /// First instruction of the cycle to its output.
        compute_ns: Times,
        /// Age of the measurement at the release.
        measured_age_ns: Times,
        /// Release to the force message sent.
        end_to_end_ns: Times,
    }
}

message! {
    /// One of the worst cycles since start, ranked by wake-up and compute time together. The last three fields
    /// cover the 20 ms around it, observed from outside the real-time thread.
    WorstCycle = "hexad_worst_cycle" {
        /// Number of the cycle, from 1; 0 beyond the end of the list.
        cycle: u64,
        /// CLOCK_MONOTONIC instant at which it was due.
        due_ns: u64 ["ns"],
        wakeup_ns: u64 ["ns"],
        compute_ns: u64 ["ns"],
        /// 1 if it used the inputs of the cycle before.
        io_late: u32,
        /// Times the kernel took the processor from the real-time thread.
        involuntary_switches: u32,
        /// Page faults of the real-time thread.
        page_faults: u32,
        /// Time the host took from the processor, in the 10 ms steps that Linux counts.
        steal_ms: u32 ["ms"],
    }
}

message! {
    /// Timing of the loop, published every second of real time.
    StatisticsMessage = "hexad_statistics" on "statistics" schema 1 {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// The last complete second.
        window: LoopTimes,
        /// Since start.
        total: LoopTimes,
        /// Since start, the worst first.
        worst: [WorstCycle; WORST_CYCLES],
    }
}

message! {
    /// Totals of the cyclic loop since start.
    LoopCounters = "hexad_loop_counters" {
        /// Cycles run.
        cycles: u64,
        /// Cycles that woke later than the configured threshold.
        late_wakeups: u64,
        /// Cycles still computing at their next release.
        overruns: u64,
        /// Release instants for which no cycle was run.
        skipped: u64,
        /// Cycles run at once because their release had passed.
        caught_up: u64,
        /// Cycle records lost because the queue to the log thread was full.
        records_lost: u64,
        /// Calls of the real-time thread to the allocator since its first cycle: zero, or something is wrong.
        allocations: u64,
    }
}

message! {
    /// Messages that a subscriber rejected, by reason.
    RejectionCounts = "hexad_rejection_counts" {
        /// Of another schema.
        schema: u64,
        /// Of another publisher than the one that counts: its last ones, or of one that publishes beside it.
        other_publisher: u64,
        /// Received before, or unreadable.
        repeated: u64,
        /// With a wrong checksum, or of a publisher that begins in the future.
        damaged: u64,
    }
}

impl core::ops::Add for RejectionCounts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            schema: self.schema + other.schema,
            other_publisher: self.other_publisher + other.other_publisher,
            repeated: self.repeated + other.repeated,
            damaged: self.damaged + other.damaged,
        }
    }
}

message! {
    /// Totals of the daemon's I/O thread since start.
    IoCounters = "hexad_io_counters" {
        /// Calls of the I/O thread to the allocator: a peer connected or disappeared.
        allocations: u64,
        /// Messages rejected on all topics that the daemon subscribes to.
        rejected: RejectionCounts,
    }
}
