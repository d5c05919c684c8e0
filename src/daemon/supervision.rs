//! Supervision of the threads by the main thread. The watchdog of the service manager is fed only while the
//! loop runs.
//!
//! Without a service manager a hanging thread is only logged, with its name.

use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use sd_notify::NotifyState;
use tracing::{error, warn};

use super::REALTIME_THREAD;
use super::reload::Requester;
use hexad_client::messages::Remains;
use hexad_client::messages::location::{SEGMENTS_DELETED, are_segments_deleted};
use hexad_client::realtime::stop_request::Hangups;
use hexad_core::control::controller::Output;
use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad_core::control::signals::state::State;

/// Interval between two checks of progress, much shorter than the timeout of any watchdog.
pub const SUPERVISION_INTERVAL: Duration = Duration::from_millis(100);

/// Interval between two searches for remains of killed participants, longer than joining or leaving takes.
const CLEANING_INTERVAL: Duration = Duration::from_secs(2);

/// Time without progress after which a thread is reported, longer than a host usually preempts a thread.
const REPORTED_AFTER: Duration = Duration::from_secs(1);

/// Progress of the threads. Each thread writes only its own fields.
#[derive(Debug, Default)]
pub struct Progress {
    cycles: AtomicU64,
    io_rounds: AtomicU64,
    state: AtomicU32,
    code: AtomicU32,
}

impl Progress {
    /// Counts a cycle of the real-time thread.
    pub fn count_cycle(&self) {
        // There is one writer, so no operation that locks the bus is needed.
        self.cycles.store(self.cycles.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }

    /// Counts a round of the I/O thread.
    pub fn count_io_round(&self) {
        self.io_rounds.store(self.io_rounds.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }

    /// Stores the state and diagnostic of the last cycle.
    pub fn set_output(&self, output: &Output) {
        self.state.store(output.state as u32, Ordering::Relaxed);
        self.code.store(output.diagnostic.code as u32, Ordering::Relaxed);
    }

    fn status(&self) -> (State, DiagnosticCode) {
        let state = State::from_number(self.state.load(Ordering::Relaxed));
        let code = DiagnosticCode::from_number(self.code.load(Ordering::Relaxed));
        (state.unwrap_or_default(), code.unwrap_or_default())
    }
}

/// A thread under supervision.
struct Supervised {
    name: &'static str,
    /// False in simulated time, in which a thread may wait for ever.
    has_to_progress: bool,
    counted: u64,
    /// Instant of the last check that found progress.
    seen: Instant,
    is_reported: bool,
}

impl Supervised {
    fn new(name: &'static str, has_to_progress: bool) -> Self {
        Self { name, has_to_progress, counted: 0, seen: Instant::now(), is_reported: false }
    }

    /// Whether there was progress since the last call.
    fn has_progressed(&mut self, count: u64) -> bool {
        if !self.has_to_progress {
            return true;
        }
        let has_progressed = count != self.counted;
        if has_progressed {
            if self.is_reported {
                warn!(thread = self.name, "the thread {} runs again", self.name);
            }
            (self.counted, self.seen, self.is_reported) = (count, Instant::now(), false);
        } else if !self.is_reported && self.seen.elapsed() > REPORTED_AFTER {
            self.is_reported = true;
            error!(thread = self.name, "the thread {} has stopped: it makes no progress", self.name);
        }
        has_progressed
    }
}

/// Supervision of the loop.
pub struct Supervision<'a> {
    progress: &'a Progress,
    threads: [Supervised; 2],
    /// Threads that have progressed since the watchdog was fed.
    has_progressed: [bool; 2],
    rate_hz: f64,
    reported: Option<(State, DiagnosticCode)>,
    looked: Instant,
    /// Counter of SIGHUP, which reloads the machine file.
    hangups: Option<Hangups>,
    request_reload: &'a Sender<Requester>,
    /// Search for remains of killed participants; `None` if it is impossible.
    remains: Option<Remains>,
    cleaned: Instant,
    /// Whether the loss of the shared memory was reported.
    are_deleted: bool,
}

impl<'a> Supervision<'a> {
    /// Reports that the daemon is ready.
    pub fn begin(
        progress: &'a Progress,
        rate_hz: f64,
        is_simulated: bool,
        request_reload: &'a Sender<Requester>,
    ) -> Self {
        let is_service = std::env::var_os("NOTIFY_SOCKET").is_some();
        // SIGHUP from a closed terminal ends the daemon; a service manager ends it by other signals.
        let hangups = is_service.then(Hangups::count).and_then(Result::ok);
        let _ = sd_notify::notify(&[NotifyState::Ready]);
        let threads = [REALTIME_THREAD, "hexad-io"].map(|name| Supervised::new(name, !is_simulated));
        Self {
            progress,
            threads,
            has_progressed: [false; 2],
            rate_hz,
            reported: None,
            looked: Instant::now(),
            hangups,
            request_reload,
            remains: Remains::open()
                .inspect_err(|error| warn!("killed participants leave files: {error}"))
                .ok(),
            cleaned: Instant::now(),
            are_deleted: false,
        }
    }

    /// Checks progress, feeds the watchdog and reports a new state.
    pub fn step(&mut self) {
        if self.looked.elapsed() < SUPERVISION_INTERVAL {
            return;
        }
        self.looked = Instant::now();
        if self.have_all_progressed() {
            let _ = sd_notify::notify(&[NotifyState::Watchdog]);
        }
        let status = self.progress.status();
        if self.reported != Some(status) {
            self.reported = Some(status);
            let _ = sd_notify::notify(&[NotifyState::Status(&text(status, self.rate_hz))]);
        }
        if self.hangups.as_mut().is_some_and(Hangups::has_new) {
            // The receiver is gone when the daemon ends.
            let _ = self.request_reload.send(None);
        }
        if let Some(remains) = self.remains.as_mut().filter(|_| self.cleaned.elapsed() >= CLEANING_INTERVAL) {
            remains.remove();
            let are_deleted = are_segments_deleted();
            if are_deleted && !self.are_deleted {
                error!("{SEGMENTS_DELETED}");
            }
            self.are_deleted = are_deleted;
            self.cleaned = Instant::now();
        }
    }

    /// Whether every thread has progressed since this last returned true.
    fn have_all_progressed(&mut self) -> bool {
        let counts = [&self.progress.cycles, &self.progress.io_rounds];
        for ((thread, count), seen) in self.threads.iter_mut().zip(counts).zip(&mut self.has_progressed) {
            *seen |= thread.has_progressed(count.load(Ordering::Relaxed));
        }
        let have_all = self.has_progressed == [true; 2];
        if have_all {
            self.has_progressed = [false; 2];
        }
        have_all
    }

    /// Reports that the daemon is about to end.
    pub fn end(&self) {
        let _ = sd_notify::notify(&[NotifyState::Stopping]);
    }
}

/// Status text for the service manager.
fn text((state, code): (State, DiagnosticCode), rate_hz: f64) -> String {
    if state.has_control() && code == DiagnosticCode::None {
        return format!("{} at {rate_hz} Hz", state.name());
    }
    format!("{} at {rate_hz} Hz: {}", state.name(), Diagnostic::from(code))
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn the_watchdog_is_fed_only_if_every_thread_has_progressed_since() {
        let progress = Progress::default();
        let (request_reload, _requests) = channel();
        let mut supervision = Supervision::begin(&progress, 1000.0, false, &request_reload);
        type Count = fn(&Progress);
        let steps: [(&[Count], bool); 6] = [
            (&[], false),
            (&[Progress::count_cycle], false),
            (&[Progress::count_cycle], false),
            (&[Progress::count_io_round], true),
            (&[Progress::count_io_round], false),
            (&[Progress::count_io_round, Progress::count_cycle], true),
        ];
        for (k, (threads, expected)) in steps.into_iter().enumerate() {
            threads.iter().for_each(|count| count(&progress));
            assert_eq!(supervision.have_all_progressed(), expected, "step {k}");
        }
        let mut simulated = Supervision::begin(&progress, 1000.0, true, &request_reload);
        assert!(simulated.have_all_progressed(), "in simulated time all may wait");
    }

    #[test]
    fn the_status_says_state_and_reason() {
        let of = |state, code| text((state, code), 500.0);
        assert_eq!(of(State::Active, DiagnosticCode::None), "active at 500 Hz");
        assert_eq!(
            of(State::Fault, DiagnosticCode::EmergencyStop),
            "fault at 500 Hz: emergency stop; clear when it is safe"
        );
    }
}
