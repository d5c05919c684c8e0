//! Signals that pause what this process plays (SIGUSR1) and let it go on (SIGUSR2).

use core::ffi::c_int;
use core::sync::atomic::{AtomicBool, Ordering};
use std::fs::read_to_string;
use std::io;

use nix::sys::signal::Signal;

use super::process::handle_signal;

/// Whether the last of both was SIGUSR1.
static IS_PAUSED: AtomicBool = AtomicBool::new(false);

/// Pause request of this process.
#[derive(Clone, Copy, Debug)]
pub struct PauseRequest(());

impl PauseRequest {
    /// Installs the handlers. Once per process.
    pub fn on_signals() -> io::Result<Self> {
        for number in [libc::SIGUSR1, libc::SIGUSR2] {
            // SAFETY: the handler stores an atomic flag.
            unsafe { handle_signal(number, handle) }?;
        }
        Ok(Self(()))
    }

    /// Whether a pause is requested.
    pub fn is_requested(self) -> bool {
        IS_PAUSED.load(Ordering::Relaxed)
    }
}

extern "C" fn handle(signal: c_int) {
    IS_PAUSED.store(signal == libc::SIGUSR1, Ordering::Relaxed);
}

/// The signal that pauses a process, or lets it go on.
pub fn pause_signal(pauses: bool) -> Signal {
    if pauses { Signal::SIGUSR1 } else { Signal::SIGUSR2 }
}

/// Whether a process handles both signals: without a handler they would end it.
pub fn handles_pause(process_id: u32) -> bool {
    let status = read_to_string(format!("/proc/{process_id}/status")).unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or_default();
    [libc::SIGUSR1, libc::SIGUSR2].iter().all(|number| mask & 1 << (number - 1) != 0)
}
