//! What the bench needs of the system: tools, processors, the right to real time.

use std::{env, fs, thread};

use hexad::realtime::setup::cpus::Cpus;
use hexad::realtime::setup::scheduling;

use super::Failure;

/// Command and the Debian package it is in.
const TOOLS: [(&str, &str); 3] =
    [("cyclictest", "rt-tests"), ("stress-ng", "stress-ng"), ("strace", "strace")];

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

/// Every tool, or which are missing and how to get them.
pub fn require_tools() -> Result<(), Failure> {
    let path = env::var("PATH").unwrap_or_default();
    let is_there = |tool: &str| env::split_paths(&path).any(|folder| folder.join(tool).is_file());
    let missing: Vec<_> = TOOLS.into_iter().filter(|(tool, _)| !is_there(tool)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let list = |pick: fn(&(&'static str, &'static str)) -> &'static str, between: &str| {
        missing.iter().map(pick).collect::<Vec<_>>().join(between)
    };
    let (tools, packages) = (list(|it| it.0, ", "), list(|it| it.1, " "));
    Err(format!("missing: {tools}; install with: apt-get install {packages}").into())
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
