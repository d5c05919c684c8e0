//! Windows of the tape in separate files: around each fault, and the last seconds for an operator.

use std::fs::File;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender};

use tracing::{info, warn};

use super::Context;
use super::fault_watch::FaultWatch;
use super::folder::Folder;
use super::stream::Stream;
use super::tape::Tape;
use crate::recording::RecordingError;
use crate::recording::file::{RecordingFile, remove_if_empty};
use hexad_client::messages::CycleMessage;

/// Cycles of a window written in one step: a millisecond of effort.
const CYCLES_PER_STEP: usize = 256;

/// Largest number of fault windows of a run.
const MAX_FAULT_WINDOWS: u32 = 100;

/// Name used in messages for the file that an operator has passed.
const PASSED_FILE: &str = "the file";

/// Order of an operator for the last seconds.
pub struct WindowOrder {
    /// File that the operator has opened.
    pub file: File,
    /// Length \[s\].
    pub last_s: f64,
    /// Channel for the number of cycles written, or the reason why there are none.
    pub answer: Sender<Result<String, String>>,
}

/// Writer of windows, one after another.
pub struct Windows {
    /// Folder for fault windows. Without it they are not written.
    folder: Option<Folder>,
    watch: FaultWatch,
    faults: u32,
    orders: Receiver<WindowOrder>,
    window: Option<Window>,
    /// Upper bound of the bytes written.
    pub bytes: u64,
}

/// Window that is being written.
struct Window {
    stream: Stream,
    last: u64,
    cycles: u64,
    /// Channel to the operator who ordered it; `None` for a fault window.
    answer: Option<Sender<Result<String, String>>>,
}

impl Windows {
    /// Writer that puts fault windows into the folder.
    pub fn new(folder: Option<Folder>, rate: u64, orders: Receiver<WindowOrder>) -> Self {
        Self { folder, watch: FaultWatch::new(rate), faults: 0, orders, window: None, bytes: 0 }
    }

    /// Whether a window is being written.
    pub fn is_writing(&self) -> bool {
        self.window.is_some()
    }

    /// Checks a new cycle of the tape for a fault.
    pub fn add(&mut self, context: &Context, tape: &Tape, cycle: &CycleMessage) {
        self.watch.add(cycle);
        if self.window.is_none() {
            self.begin_fault(context, tape, false);
        }
    }

    /// Writes a part of a window, and begins the next one ordered.
    pub fn advance(&mut self, context: &Context, tape: &Tape) {
        if self.window.is_none()
            && let Ok(order) = self.orders.try_recv()
        {
            self.begin_order(context, tape, order);
        }
        let Some(window) = &mut self.window else { return };
        match window.advance(context, tape) {
            Ok(false) => {}
            Ok(true) => self.finish_window(),
            Err(error) => {
                if let Some(window) = self.window.take() {
                    window.conclude(Err(error));
                }
            }
        }
    }

    /// Writes the remaining windows.
    pub fn finish(&mut self, context: &Context, tape: &Tape) {
        loop {
            while self.window.is_some() {
                self.advance(context, tape);
            }
            self.begin_fault(context, tape, true);
            if self.window.is_none() {
                return;
            }
        }
    }

    fn begin_fault(&mut self, context: &Context, tape: &Tape, is_ending: bool) {
        let Some((code, fault)) = self.watch.due(is_ending) else { return };
        let Some(folder) = self.folder.as_ref().filter(|_| self.faults < MAX_FAULT_WINDOWS) else { return };
        self.faults += 1;
        if self.faults == MAX_FAULT_WINDOWS {
            warn!("this was fault number {MAX_FAULT_WINDOWS}: the cycles of later ones are not written");
        }
        let path = folder.make_room_for_file(&format!("fault-{code}-cycle-{fault}"));
        match RecordingFile::create(&path, &context.info, Some(fault)) {
            Ok(file) => self.window = Some(Window::new(file, tape, tape.first_replayable_or_0(0), None)),
            Err(error) => warn!("the cycles around the fault are lost: {error}"),
        }
    }

    fn begin_order(&mut self, context: &Context, tape: &Tape, order: WindowOrder) {
        let WindowOrder { file, last_s, answer } = order;
        if tape.newest() == 0 {
            let _ = answer.send(Err("no cycle has run yet".into()));
            return;
        }
        let from = tape.newest().saturating_sub((last_s * context.rate as f64) as u64);
        match RecordingFile::write_to(file, Path::new(PASSED_FILE), &context.info, None) {
            Ok(file) => {
                self.window = Some(Window::new(file, tape, tape.first_replayable_or_0(from), Some(answer)))
            }
            Err(error) => drop(answer.send(Err(error.to_string()))),
        }
    }

    fn finish_window(&mut self) {
        let Some(window) = self.window.take() else { return };
        self.bytes += window.stream.file.bytes();
        window.conclude(Ok(()));
    }
}

impl Window {
    /// Window of the tape from a cycle on.
    fn new(
        file: RecordingFile,
        tape: &Tape,
        first: u64,
        answer: Option<Sender<Result<String, String>>>,
    ) -> Self {
        Self { stream: Stream::new(file, first), last: tape.newest(), cycles: 0, answer }
    }

    /// Writes some cycles. Returns whether the last one is written.
    fn advance(&mut self, context: &Context, tape: &Tape) -> Result<bool, RecordingError> {
        let last = self.last;
        let cycles = tape.from(self.stream.next_cycle).take_while(|cycle| cycle.cycle <= last);
        for cycle in cycles.take(CYCLES_PER_STEP) {
            self.stream.write(context, tape, cycle)?;
            self.cycles += 1;
        }
        Ok(self.stream.next_cycle > last)
    }

    /// Completes the file, and reports the result to the operator or the log.
    fn conclude(self, written: Result<(), RecordingError>) {
        let Self { stream, cycles, answer, .. } = self;
        let path = stream.file.path().to_path_buf();
        let result = written.and_then(|()| stream.file.finish());
        match answer {
            // The receiver is gone if the client has left.
            Some(answer) => {
                let _ = answer
                    .send(result.map(|_| format!("{cycles} cycles")).map_err(|error| error.to_string()));
            }
            None => match result {
                Ok(path) => info!("the cycles around the fault are in {}", path.display()),
                Err(error) => {
                    let _ = remove_if_empty(&path);
                    warn!("the cycles around the fault are lost: {error}");
                }
            },
        }
    }
}
