//! Witness of the host: threads with real-time priority, one for each processor, that notice when their processor is taken away.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, spawn};

use hexad::messages::clock::monotonic_ns;
use hexad::realtime::clock::sleep_until;
use hexad::realtime::setup::scheduling;

/// Time between two looks \[ns\].
const INTERVAL_NS: u64 = 200_000;
/// A look later than this is a pause \[ns\]: half a period of the loop, and more than any thread of the daemon takes.
const PAUSE_NS: u64 = 500_000;
/// Above the daemon's control thread and all that is not the loop itself.
const PRIORITY: i32 = 70;

/// Pauses of the processors since the start.
pub struct Witness {
    processors: Vec<Arc<Looks>>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

/// Looks of the thread of one processor.
#[derive(Default)]
struct Looks {
    /// Instant of the last one \[ns\]. All pauses before it are known.
    last_ns: AtomicU64,
    pauses: Mutex<Vec<[u64; 2]>>,
}

impl Looks {
    fn look_until(&self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let from_ns = monotonic_ns();
            sleep_until(from_ns + INTERVAL_NS);
            let until_ns = monotonic_ns();
            if until_ns - from_ns > INTERVAL_NS + PAUSE_NS {
                self.pauses.lock().expect("no panic while it was held").push([from_ns, until_ns]);
            }
            self.last_ns.store(until_ns, Ordering::Release);
        }
    }

    /// Pauses between two instants. Waits for a look after them: a processor that is away has not noticed it yet.
    fn pauses(&self, from_ns: u64, until_ns: u64) -> Vec<[u64; 2]> {
        while self.last_ns.load(Ordering::Acquire) <= until_ns {
            sleep_until(monotonic_ns() + INTERVAL_NS);
        }
        let pauses = self.pauses.lock().expect("no panic while it was held");
        let within =
            pauses.iter().map(|[begin_ns, end_ns]| [*begin_ns.max(&from_ns), *end_ns.min(&until_ns)]);
        within.filter(|[begin_ns, end_ns]| begin_ns < end_ns).collect()
    }
}

impl Witness {
    /// None without the right to real-time priority.
    pub fn start() -> Option<Self> {
        spawn(|| scheduling::fifo_priority(PRIORITY).is_ok()).join().ok().filter(|granted| *granted)?;
        let stop = Arc::new(AtomicBool::new(false));
        let count = std::thread::available_parallelism().map_or(1, usize::from);
        let processors: Vec<_> = (0..count).map(|_| Arc::new(Looks::default())).collect();
        let start = |(processor, looks): (usize, &Arc<Looks>)| {
            let (looks, stop) = (looks.clone(), stop.clone());
            spawn(move || {
                let _ = (scheduling::fifo_priority(PRIORITY), scheduling::bind_to_cpu(processor));
                looks.look_until(&stop);
            })
        };
        let threads = processors.iter().enumerate().map(start).collect();
        Some(Self { processors, stop, threads })
    }

    /// Time between two instants in which a processor, or more of them, was away \[ns\].
    pub fn paused_ns(&self, from_ns: u64, until_ns: u64) -> u64 {
        let mut pauses: Vec<_> =
            self.processors.iter().flat_map(|looks| looks.pauses(from_ns, until_ns)).collect();
        pauses.sort_unstable();
        let (mut paused_ns, mut counted_ns) = (0, from_ns);
        for [begin_ns, end_ns] in pauses {
            paused_ns += end_ns.saturating_sub(begin_ns.max(counted_ns));
            counted_ns = counted_ns.max(end_ns);
        }
        paused_ns
    }
}

impl Drop for Witness {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| thread.join().expect("a witness"));
    }
}
