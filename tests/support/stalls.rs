//! A watchdog on the host: threads that sleep a millisecond at a time and notice when it took longer.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{JoinHandle, available_parallelism, sleep, spawn};
use std::time::{Duration, Instant};

use hexad::realtime::setup::scheduling;

const NAP: Duration = Duration::from_millis(1);

/// Above every thread under test, so that what is seen is the host.
const PRIORITY: i32 = 98;

/// One thread on each processor: the host may take a single one away.
pub struct Watchdog {
    stop: Arc<AtomicBool>,
    largest_ns: Arc<AtomicU64>,
    threads: Vec<JoinHandle<()>>,
}

impl Watchdog {
    pub fn start() -> Self {
        Self::at(Some(PRIORITY))
    }

    /// As a simulated plant and a source run: whatever takes the processors from them counts.
    pub fn start_ordinary() -> Self {
        Self::at(None)
    }

    fn at(priority: Option<i32>) -> Self {
        let (stop, largest_ns) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let processors = available_parallelism().map_or(1, usize::from);
        let threads = (0..processors)
            .map(|cpu| {
                let (stop, largest_ns) = (stop.clone(), largest_ns.clone());
                spawn(move || watch(cpu, priority, &stop, &largest_ns))
            })
            .collect();
        Self { stop, largest_ns, threads }
    }

    /// The largest gap so far.
    pub fn largest(&self) -> Duration {
        Duration::from_nanos(self.largest_ns.load(Ordering::Relaxed))
    }
}

fn watch(cpu: usize, priority: Option<i32>, stop: &AtomicBool, largest_ns: &AtomicU64) {
    // Best effort: without the right to it, the watchdog sees at least as much as the host does.
    let _ = (priority.map(scheduling::fifo_priority), scheduling::bind_to_cpu(cpu));
    while !stop.load(Ordering::Relaxed) {
        let before = Instant::now();
        sleep(NAP);
        let gap = before.elapsed().saturating_sub(NAP);
        largest_ns.fetch_max(gap.as_nanos() as u64, Ordering::Relaxed);
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}
