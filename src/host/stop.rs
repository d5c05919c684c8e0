//! The wish of the operator to stop (SIGINT, SIGTERM, SIGHUP), as a flag.

extern crate std;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::Arc;
use std::thread;

/// Set once by a signal, never cleared.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Catches the signals for this process. Once per process.
    pub fn on_signals() -> Result<Self, ctrlc::Error> {
        let stop = Self::default();
        let flag = stop.clone();
        let main = thread::current();
        ctrlc::set_handler(move || {
            flag.0.store(true, Ordering::Relaxed);
            main.unpark();
        })?;
        Ok(stop)
    }

    /// Whether it is time to stop.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Sleeps until a signal; for the thread that called [`Stop::on_signals`].
    pub fn wait(&self) {
        while !self.requested() {
            // A signal unparks at once; the time-out only guards against an unpark that came too early.
            thread::park_timeout(Duration::from_secs(1));
        }
    }
}
