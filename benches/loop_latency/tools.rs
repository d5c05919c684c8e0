//! What the bench needs of the system: tools, processors, the right to real time.

use std::process::{Command, Stdio};
use std::{fs, thread};

use hexad::realtime::setup::cpus::Cpus;
use hexad::realtime::setup::scheduling;

use super::Failure;

/// Program that measures or loads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    Cyclictest,
    StressNg,
    Strace,
}

impl Tool {
    pub const ALL: [Self; 3] = [Self::Cyclictest, Self::StressNg, Self::Strace];

    pub fn name(self) -> &'static str {
        match self {
            Self::Cyclictest => "cyclictest",
            Self::StressNg => "stress-ng",
            Self::Strace => "strace",
        }
    }

    /// Its Debian package.
    pub fn package(self) -> &'static str {
        if self == Self::Cyclictest { "rt-tests" } else { self.name() }
    }

    /// What is not measured without it.
    pub fn part(self) -> &'static str {
        match self {
            Self::Cyclictest => "rounds of cyclictest",
            Self::StressNg => "rounds under load",
            Self::Strace => "system calls of the real-time thread",
        }
    }

    /// Whether it can be started.
    pub fn is_there(self) -> bool {
        let mut command = Command::new(self.name());
        command.arg("--help").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok()
    }
}

/// The processors of the bench.
#[derive(Clone, Debug)]
pub struct Processors {
    /// All that this process may use.
    pub allowed: Cpus,
    /// Of the loop and of cyclictest.
    pub contestant: usize,
    /// Of the io thread and the driver.
    pub helpers: usize,
    /// Of the polling subscriber: one of its own, or where there are only two that of the helpers.
    pub subscriber: usize,
}

/// The right to FIFO priority, tried in a thread that then ends.
pub fn require_realtime(priority: i32) -> Result<(), Failure> {
    let tried = thread::spawn(move || scheduling::fifo_priority(priority)).join();
    tried.map_err(|_| "cannot try FIFO priority")?.map_err(|shortfall| shortfall.to_string().into())
}

/// The processors that this process may use.
pub fn processors() -> Result<Processors, Failure> {
    let allowed = Cpus::of_this_thread();
    let (helpers, subscriber, contestant) = match allowed.iter().collect::<Vec<_>>()[..] {
        [helpers, .., subscriber, contestant] => (helpers, subscriber, contestant),
        [helpers, contestant] => (helpers, helpers, contestant),
        _ => return Err("needs two processors: one for the loop, one for the rest".into()),
    };
    Ok(Processors { allowed, contestant, helpers, subscriber })
}

/// Time that the host has taken from a processor since start \[ms\]; Linux counts in 10 ms.
pub fn steal_ms(cpu: usize) -> u64 {
    let stat = fs::read_to_string("/proc/stat").unwrap_or_default();
    let line = stat.lines().find_map(|line| line.strip_prefix(&format!("cpu{cpu} ")));
    let ticks = line.and_then(|line| line.split_whitespace().nth(7)?.parse::<u64>().ok());
    ticks.unwrap_or_default() * 10
}
