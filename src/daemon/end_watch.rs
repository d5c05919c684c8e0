//! The end of the daemon does not wait for a file system that does not answer: if no thread makes progress, the process ends.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::Builder;
use std::time::Duration;
use std::{fs, process};

use nix::unistd;

use super::recording::file::writes;
use hexad_client::realtime::process::block_signals;
use hexad_machine::log::report_failure;

/// Longest time at the end in which nothing is written to files.
const END_LIMIT: Duration = Duration::from_millis(700);

/// Starts the watch, until the result is dropped; `None` if there is no further thread.
pub(super) fn end_watch() -> Option<Sender<()>> {
    let (ended, end) = channel();
    let watch = move || {
        block_signals();
        let mut before = writes();
        while end.recv_timeout(END_LIMIT) == Err(RecvTimeoutError::Timeout) {
            if before == writes() && !is_any_thread_runnable() {
                report_failure(
                    "a file system does not answer: the daemon ends without the rest of its files",
                );
                process::exit(1);
            }
            before = writes();
        }
    };
    Builder::new().name("hexad-end".into()).spawn(watch).is_ok().then_some(ended)
}

/// Whether a thread but this one has work that it could do: it is short of processor time, and does not hang.
fn is_any_thread_runnable() -> bool {
    let own = unistd::gettid().to_string();
    let threads = fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    threads.filter(|thread| *thread.file_name() != *own).any(|thread| {
        let stat = fs::read_to_string(thread.path().join("stat")).unwrap_or_default();
        stat.rsplit_once(") ").is_some_and(|(_, state)| state.starts_with('R'))
    })
}
