//! Witness of the host: threads with real-time priority, one for each processor, that notice when their processor is taken away.

use std::sync::atomic::{AtomicBool, Ordering};
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
    pauses: Arc<Mutex<Vec<[u64; 2]>>>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Witness {
    /// None without the right to real-time priority.
    pub fn start() -> Option<Self> {
        spawn(|| scheduling::fifo_priority(PRIORITY).is_ok()).join().ok().filter(|granted| *granted)?;
        let (pauses, stop) = (Arc::new(Mutex::new(vec![])), Arc::new(AtomicBool::new(false)));
        let count = std::thread::available_parallelism().map_or(1, usize::from);
        let start = |processor: usize| {
            let (pauses, stop): (Arc<Mutex<Vec<_>>>, Arc<AtomicBool>) = (pauses.clone(), stop.clone());
            spawn(move || {
                let _ = (scheduling::fifo_priority(PRIORITY), scheduling::bind_to_cpu(processor));
                while !stop.load(Ordering::Relaxed) {
                    let from_ns = monotonic_ns();
                    sleep_until(from_ns + INTERVAL_NS);
                    let until_ns = monotonic_ns();
                    if until_ns - from_ns > INTERVAL_NS + PAUSE_NS {
                        pauses.lock().expect("no panic while it was held").push([from_ns, until_ns]);
                    }
                }
            })
        };
        let threads = (0..count).map(start).collect();
        Some(Self { pauses, stop, threads })
    }

    /// Time of pauses of any processor between two instants, and at least one look before and after them \[ns\].
    pub fn paused_ns(&self, from_ns: u64, until_ns: u64) -> u64 {
        // The look that notices a pause may be on its way.
        sleep_until(monotonic_ns() + 2 * INTERVAL_NS);
        let pauses = self.pauses.lock().expect("no panic while it was held");
        let within =
            |[begin_ns, end_ns]: &[u64; 2]| end_ns.min(&until_ns).saturating_sub(*begin_ns.max(&from_ns));
        pauses.iter().map(within).sum()
    }
}

impl Drop for Witness {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| thread.join().expect("a witness"));
    }
}
