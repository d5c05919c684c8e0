//! The wish of the operator to stop (SIGINT, SIGTERM, SIGHUP), and how often it was said.

use core::sync::atomic::{AtomicU32, Ordering};
use core::time::Duration;
use std::sync::Arc;
use std::thread;

/// Counts signals.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicU32>);

impl Stop {
    /// Catches the signals for this process. Once per process.
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

    /// Whether it is time to stop.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }

    /// Whether it was said more than once: at once, then, and not in order.
    pub fn is_repeated(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 1
    }

    /// Sleeps until a signal; for the thread that called [`Stop::on_signals`].
    pub fn wait(&self) {
        while !self.is_requested() {
            // A signal unparks at once; the time-out only guards against an unpark that came too early.
            thread::park_timeout(Duration::from_secs(1));
        }
    }
}
