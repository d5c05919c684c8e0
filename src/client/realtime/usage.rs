//! Resource usage of a thread, counted by the kernel and the allocator.

use super::allocation::allocator_calls_of_this_thread;

/// Resource usage of one thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ThreadUsage {
    /// Calls to the allocator; counted only where [`super::allocation::CountingAllocator`] is installed.
    pub allocations: u64,
    /// Page faults without I/O.
    pub minor_faults: u64,
    /// Page faults with I/O.
    pub major_faults: u64,
    /// Context switches because the thread waited.
    pub voluntary_switches: u64,
    /// Context switches because another thread ran.
    pub involuntary_switches: u64,
}

impl ThreadUsage {
    /// Calls to the allocator alone: no system call.
    pub fn allocator_calls_of_this_thread() -> u64 {
        allocator_calls_of_this_thread()
    }

    /// Usage of the calling thread since its start. A system call.
    pub fn of_this_thread() -> Self {
        // SAFETY: all-zero is a valid rusage, a plain struct of integers.
        let mut usage: libc::rusage = unsafe { core::mem::zeroed() };
        // SAFETY: `usage` is valid for the duration of the call. RUSAGE_THREAD cannot fail on Linux.
        unsafe { libc::getrusage(libc::RUSAGE_THREAD, &mut usage) };
        Self {
            allocations: allocator_calls_of_this_thread(),
            minor_faults: usage.ru_minflt as u64,
            major_faults: usage.ru_majflt as u64,
            voluntary_switches: usage.ru_nvcsw as u64,
            involuntary_switches: usage.ru_nivcsw as u64,
        }
    }

    /// Usage since `earlier`.
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
