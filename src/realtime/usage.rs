//! What the kernel and the allocator say a thread has used.

use super::allocation::calls_of_this_thread;

/// Counts of one thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ThreadUsage {
    /// Calls to the allocator; counted only where [`super::allocation::CountingAllocator`] is installed.
    pub allocations: u64,
    pub minor_faults: u64,
    pub major_faults: u64,
    pub voluntary_switches: u64,
    pub involuntary_switches: u64,
}

impl ThreadUsage {
    /// Calls to the allocator alone: no system call.
    pub fn allocations_of_this_thread() -> u64 {
        calls_of_this_thread()
    }

    /// Since the calling thread began. A system call.
    pub fn of_this_thread() -> Self {
        // SAFETY: all-zero is a valid rusage, a plain struct of integers.
        let mut usage: libc::rusage = unsafe { core::mem::zeroed() };
        // SAFETY: `usage` is valid for the duration of the call. RUSAGE_THREAD cannot fail on Linux.
        unsafe { libc::getrusage(libc::RUSAGE_THREAD, &mut usage) };
        Self {
            allocations: calls_of_this_thread(),
            minor_faults: usage.ru_minflt as u64,
            major_faults: usage.ru_majflt as u64,
            voluntary_switches: usage.ru_nvcsw as u64,
            involuntary_switches: usage.ru_nivcsw as u64,
        }
    }

    /// What was used since `earlier`.
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            allocations: self.allocations - earlier.allocations,
            minor_faults: self.minor_faults - earlier.minor_faults,
            major_faults: self.major_faults - earlier.major_faults,
            voluntary_switches: self.voluntary_switches - earlier.voluntary_switches,
            involuntary_switches: self.involuntary_switches - earlier.involuntary_switches,
        }
    }
}
