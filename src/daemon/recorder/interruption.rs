//! Interruption of the recording, from the recorder to the control thread. No thread waits for the other.

use core::sync::atomic::{AtomicU64, Ordering};
use hexad_core::control::signals::time::seconds_since_or_0;
use std::path::PathBuf;

use nix::sys::statvfs::statvfs;

use hexad_client::messages::clock::monotonic_ns;

/// Whether the recording of every cycle is interrupted, and since when.
#[derive(Debug, Default)]
pub struct Interruption {
    folder: PathBuf,
    /// CLOCK_MONOTONIC instant of the first failed attempt \[ns\]; 0 while the recording is not interrupted.
    since_ns: AtomicU64,
    /// Free space of the folder at the last attempt \[bytes\]; `u64::MAX` if it is unknown.
    free_bytes: AtomicU64,
}

impl Interruption {
    /// A recording into a folder, not interrupted.
    pub fn of(folder: PathBuf) -> Self {
        Self { folder, ..Self::default() }
    }

    /// Whether the recording is interrupted.
    pub fn is_ongoing(&self) -> bool {
        self.since_ns.load(Ordering::Relaxed) > 0
    }

    /// Notes a failed attempt. Returns whether the interruption begins with it.
    pub fn note(&self) -> bool {
        let free = statvfs(&self.folder).map_or(u64::MAX, |of| of.blocks_available() * of.fragment_size());
        self.free_bytes.store(free, Ordering::Relaxed);
        let (begins, now_ns) = (!self.is_ongoing(), monotonic_ns());
        if begins {
            self.since_ns.store(now_ns, Ordering::Relaxed);
        }
        begins
    }

    /// Ends it. Returns how long it has lasted \[s\].
    pub fn end(&self) -> f64 {
        seconds_since_or_0(self.since_ns.swap(0, Ordering::Relaxed), monotonic_ns())
    }

    /// Free space at the last attempt.
    pub fn free_text(&self) -> String {
        match self.free_bytes.load(Ordering::Relaxed) {
            u64::MAX => "unknown free space".into(),
            free => format!("{:.1} MiB free", free as f64 / f64::from(1 << 20)),
        }
    }

    /// The interruption at an instant \[ns\], with its remedy; `None` if there is none.
    pub fn warning(&self, now_ns: u64) -> Option<String> {
        let since_ns = Some(self.since_ns.load(Ordering::Relaxed)).filter(|since_ns| *since_ns > 0)?;
        let (folder, free) = (self.folder.display(), self.free_text());
        let lasted_s = seconds_since_or_0(since_ns, now_ns);
        Some(format!(
            "the recording in {folder} has been interrupted for {lasted_s:.0} s, with {free}: make room for the 30 s in \
             memory and what follows (docs/recording.md, Size), and it goes on by itself; the log has the cause"
        ))
    }
}
