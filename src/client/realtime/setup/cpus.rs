//! Sets of processors in the notation of Linux: `0-3,8`.

use core::fmt::{self, Display, Formatter};
use std::collections::BTreeSet;
use std::{fs, thread};

/// Set of processors, numbered from 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cpus(BTreeSet<usize>);

impl Cpus {
    /// Processors that are online.
    pub fn online() -> Self {
        Self::of_file("/sys/devices/system/cpu/online")
    }

    /// Processors that the scheduler does not balance over (boot parameter `isolcpus`).
    pub fn isolated() -> Self {
        Self::of_file("/sys/devices/system/cpu/isolated")
    }

    /// Affinity of the calling thread.
    pub fn of_this_thread() -> Self {
        // SAFETY: all-zero is the empty set.
        let mut set: libc::cpu_set_t = unsafe { core::mem::zeroed() };
        // SAFETY: 0 means the calling thread; the size is that of `set`. If it fails the set remains empty.
        unsafe { libc::sched_getaffinity(0, size_of::<libc::cpu_set_t>(), &mut set) };
        // SAFETY: every number is below the size of the set.
        Self((0..libc::CPU_SETSIZE as usize).filter(|cpu| unsafe { libc::CPU_ISSET(*cpu, &set) }).collect())
    }

    /// Processors that a thread of this process may be bound to: the cpuset of its cgroup. Found by a thread that
    /// requests all and ends.
    pub fn permitted() -> Self {
        let request_all = || {
            bind(0..libc::CPU_SETSIZE as usize);
            Self::of_this_thread()
        };
        thread::Builder::new()
            .spawn(request_all)
            .ok()
            .and_then(|thread| thread.join().ok())
            .unwrap_or_default()
    }

    /// Whether a processor is in the set.
    pub fn contains(&self, cpu: usize) -> bool {
        self.0.contains(&cpu)
    }

    /// The set without `others`.
    pub fn without(&self, others: &Self) -> Self {
        Self(self.0.difference(&others.0).copied().collect())
    }

    /// The processors, ascending.
    pub fn iter(&self) -> impl Iterator<Item = usize> {
        self.0.iter().copied()
    }

    /// Whether the set is empty.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn of_file(path: &str) -> Self {
        fs::read_to_string(path).ok().and_then(|list| Self::parse(&list)).unwrap_or_default()
    }

    /// Reads `0-3,8`; `None` if it is no such list.
    pub fn parse(list: &str) -> Option<Self> {
        let mut cpus = BTreeSet::new();
        for range in list.trim().split(',').filter(|range| !range.is_empty()) {
            let (first, last) = range.split_once('-').unwrap_or((range, range));
            cpus.extend(first.parse::<usize>().ok()?..=last.parse().ok()?);
        }
        Some(Self(cpus))
    }
}

/// Binds the calling thread to these processors; false if Linux refuses.
pub(super) fn bind(cpus: impl Iterator<Item = usize>) -> bool {
    // SAFETY: all-zero is the empty set; CPU_SET ignores numbers beyond its size.
    let set = unsafe {
        let mut set: libc::cpu_set_t = core::mem::zeroed();
        cpus.for_each(|cpu| libc::CPU_SET(cpu, &mut set));
        set
    };
    // SAFETY: 0 means the calling thread; the size is that of `set`.
    unsafe { libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set) == 0 }
}

impl Display for Cpus {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for first in self.0.iter().copied().filter(|cpu| *cpu == 0 || !self.contains(cpu - 1)) {
            let last = (first..).take_while(|cpu| self.contains(*cpu)).last().unwrap_or(first);
            write!(out, "{separator}{first}")?;
            if last > first {
                write!(out, "-{last}")?;
            }
            separator = ",";
        }
        if self.is_empty() { out.write_str("none") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_read_back_as_they_were_written() {
        for list in ["0", "0-1", "1,3-5,8", "0-1023"] {
            assert_eq!(Cpus::parse(list).unwrap().to_string(), list);
        }
        assert_eq!(Cpus::parse("\n").unwrap().to_string(), "none");
        assert_eq!(Cpus::parse("0-x"), None);
    }

    #[test]
    fn this_thread_runs_on_processors_that_are_permitted_and_online() {
        let (now, permitted, online) = (Cpus::of_this_thread(), Cpus::permitted(), Cpus::online());
        assert!(!now.is_empty());
        assert!(now.without(&permitted).is_empty(), "{now} of {permitted}");
        assert!(permitted.without(&online).is_empty(), "{permitted} of {online}");
    }

    #[test]
    fn a_bound_thread_is_permitted_what_others_are() {
        let permitted = Cpus::permitted();
        let first = *permitted.0.first().unwrap();
        let bound =
            thread::spawn(move || (bind(core::iter::once(first)), Cpus::of_this_thread(), Cpus::permitted()));
        assert_eq!(bound.join().unwrap(), (true, Cpus([first].into()), permitted));
    }
}
