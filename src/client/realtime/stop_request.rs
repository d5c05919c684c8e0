//! Requests to stop by signal (SIGINT, SIGTERM, SIGHUP), counted.

use core::ffi::c_int;
use core::sync::atomic::{AtomicU32, Ordering};
use core::time::Duration;
use std::io;
use std::sync::Arc;
use std::thread;

use super::process::handle_signal;
use crate::messages::clock::monotonic_ns;

/// Least time between two signals that are two requests: `timeout`, a terminal and a supervisor each signal a process and its group.
const REPEAT_INTERVAL_NS: u64 = 200_000_000;

/// Stop request of this process: a count of its signals.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicU32>);

impl Stop {
    /// Installs the handler. Once per process.
    pub fn on_signals() -> Result<Self, ctrlc::Error> {
        let stop = Self::default();
        let flag = stop.clone();
        let main = thread::current();
        let mut last_ns = None;
        ctrlc::set_handler(move || {
            let now_ns = monotonic_ns();
            if last_ns.is_none_or(|last_ns| now_ns - last_ns > REPEAT_INTERVAL_NS) {
                last_ns = Some(now_ns);
                flag.0.fetch_add(1, Ordering::Relaxed);
            }
            main.unpark();
        })?;
        Ok(stop)
    }

    /// Requests the end, as a signal does.
    pub fn request(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    /// Whether a signal has arrived.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }

    /// Whether more than one signal has arrived: the process then ends at once instead of in order.
    pub fn is_repeated(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 1
    }

    /// Sleeps for a time or until a signal arrives; for the thread that called [`Stop::on_signals`].
    pub fn wait(&self, time: Duration) {
        if !self.is_requested() {
            thread::park_timeout(time);
        }
    }
}

/// SIGHUPs of this process since [`Hangups::count`].
static HANGUPS: AtomicU32 = AtomicU32::new(0);

/// SIGHUPs, counted instead of a request to stop.
#[derive(Debug)]
pub struct Hangups {
    seen: u32,
}

impl Hangups {
    /// Counts SIGHUP from now on; it replaces what [`Stop::on_signals`] has installed.
    pub fn count() -> io::Result<Self> {
        // SAFETY: the handler adds to an atomic number.
        unsafe { handle_signal(libc::SIGHUP, count_hangup) }?;
        Ok(Self { seen: 0 })
    }

    /// Whether one has arrived since the last call.
    pub fn has_new(&mut self) -> bool {
        let count = HANGUPS.load(Ordering::Relaxed);
        core::mem::replace(&mut self.seen, count) != count
    }
}

extern "C" fn count_hangup(_: c_int) {
    HANGUPS.fetch_add(1, Ordering::Relaxed);
}
