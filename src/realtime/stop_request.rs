//! Requests to stop by signal (SIGINT, SIGTERM, SIGHUP), counted.

use core::sync::atomic::{AtomicU32, Ordering};
use core::time::Duration;
use std::sync::Arc;
use std::thread;

/// Stop request of this process: a count of its signals.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicU32>);

impl Stop {
    /// Installs the handler. Once per process.
    pub fn on_signals() -> Result<Self, ctrlc::Error> {
        let stop = Self::default();
        let flag = stop.clone();
        let main = thread::current();
        ctrlc::set_handler(move || {
            flag.0.fetch_add(1, Ordering::Relaxed);
            main.unpark();
        })?;
        Ok(stop)
    }

    /// Whether a signal has arrived.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }

    /// Whether more than one signal has arrived: the process then ends at once instead of in order.
    pub fn is_repeated(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 1
    }

    /// Sleeps until a signal arrives; for the thread that called [`Stop::on_signals`].
    pub fn wait(&self) {
        while !self.is_requested() {
            // A signal unparks at once; the time-out only guards against an unpark that came too early.
            thread::park_timeout(Duration::from_secs(1));
        }
    }
}
