//! Lines of the log on their way out. Whoever logs puts its line into a queue and never waits: the reader of the log may have stopped (a
//! terminal with Ctrl-S, a pipe that nobody reads, a journal that hangs), and the platform must still hear a stop.

use core::sync::atomic::{AtomicU64, Ordering};
use std::io::{self, Write};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::Builder;
use std::time::Duration;

use hexad_client::realtime::process::block_signals;
use tracing::warn;
use tracing_subscriber::fmt::MakeWriter;

/// Lines that may wait. Those beyond are lost, and counted.
const CAPACITY: usize = 4096;

/// Longest wait for the lines at the end of the process.
const END_LIMIT: Duration = Duration::from_millis(500);

/// Writes a line.
type Sink = Box<dyn FnMut(&[u8]) -> io::Result<()> + Send>;

enum Item {
    Line(Vec<u8>),
    /// To be answered when all lines before it are written.
    Flush(SyncSender<()>),
}

static OUTLET: OnceLock<SyncSender<Item>> = OnceLock::new();
static LOST: AtomicU64 = AtomicU64::new(0);

/// Starts the thread that writes. Without it, each thread writes its own lines.
pub fn start(mut sink: Sink) {
    let (lines, queue) = sync_channel(CAPACITY);
    let body = move || {
        block_signals();
        write_all(&queue, &mut sink);
    };
    if Builder::new().name("hexad-log-out".into()).spawn(body).is_ok() {
        let _ = OUTLET.set(lines);
    }
}

fn write_all(queue: &Receiver<Item>, sink: &mut Sink) {
    for item in queue {
        match item {
            // A log that is closed is nobody's failure.
            Item::Line(line) => drop(sink(&line)),
            Item::Flush(written) => drop(written.send(())),
        }
        match LOST.swap(0, Ordering::Relaxed) {
            0 => {}
            lost => warn!(lost, "lines of the log are lost: its reader had stopped"),
        }
    }
}

/// Passes a line on.
pub fn put(line: Vec<u8>) {
    match OUTLET.get() {
        None => _ = io::stderr().write_all(&line),
        Some(outlet) if outlet.try_send(Item::Line(line)).is_ok() => {}
        Some(_) => _ = LOST.fetch_add(1, Ordering::Relaxed),
    }
}

/// The log of the process. Before it ends, its lines are written, unless that takes long.
#[must_use = "it ends with this"]
pub struct Log;

impl Drop for Log {
    fn drop(&mut self) {
        let (written, ack) = sync_channel(1);
        if OUTLET.get().is_some_and(|outlet| outlet.try_send(Item::Flush(written)).is_ok()) {
            let _ = ack.recv_timeout(END_LIMIT);
        }
    }
}

/// Writer of whole lines.
pub struct Lines;

impl Write for Lines {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        put(line.to_vec());
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for Lines {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        Self
    }
}
