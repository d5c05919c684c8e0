//! Recording of every cycle, in consecutive files.
//!
//! If the disk accepts no data, the recording is interrupted. It continues in a new file once there is room,
//! with the first cycle that may be missing on disk. No cycle is lost while the tape still holds that cycle.

use std::fs;
use std::sync::Arc;

use tracing::{info, warn};

use super::Context;
use super::folder::Folder;
use super::interruption::Interruption;
use super::stream::Stream;
use super::tape::Tape;
use crate::recording::RecordingError;
use crate::recording::file::{RecordingFile, remove_if_empty};
use hexad_client::messages::CycleMessage;

/// Time between two attempts while the disk accepts no data \[s\].
const RETRY_S: u64 = 2;

/// The recording of every cycle.
pub struct Continuous {
    folder: Folder,
    files: u32,
    /// Bytes in completed files.
    ended_bytes: u64,
    stream: Option<Stream>,
    /// The first cycle that may be missing on disk: the first of a second, or of a file.
    pub unsaved_cycle: u64,
    /// Whether the disk has recently accepted no data.
    interruption: Arc<Interruption>,
    /// No attempt is made before this cycle.
    retry_cycle: u64,
    /// Cycles that were not on disk when memory had no more room for them, or when the run ended.
    pub unwritten: u64,
    /// Unwritten cycles before this cycle are counted.
    counted_cycle: u64,
}

impl Continuous {
    /// Recording into a folder, from the first cycle on.
    pub fn new(folder: Folder, interruption: Arc<Interruption>) -> Self {
        Self {
            folder,
            files: 0,
            ended_bytes: 0,
            stream: None,
            unsaved_cycle: 1,
            interruption,
            retry_cycle: 0,
            unwritten: 0,
            counted_cycle: 0,
        }
    }

    /// Bytes written, at most.
    pub fn bytes(&self) -> u64 {
        self.ended_bytes + self.stream.as_ref().map_or(0, |stream| stream.file.bytes())
    }

    /// Writes the new cycles of the tape.
    pub fn advance(&mut self, context: &Context, tape: &Tape) {
        if tape.newest() < self.retry_cycle {
            return;
        }
        if let Err(error) = self.write(context, tape) {
            self.interrupt(&error);
            self.retry_cycle = tape.newest() + RETRY_S * context.rate;
        }
    }

    /// Completes the last file.
    pub fn finish(&mut self, context: &Context, tape: &Tape) {
        self.retry_cycle = 0;
        self.advance(context, tape);
        if self.interruption.is_ongoing() && self.stream.is_none() {
            let lost = self.count_unwritten(tape.newest() + 1);
            warn!(lost, "the recording ends with cycles that are not on disk");
        }
        let Some(stream) = self.stream.take() else { return };
        self.ended_bytes += stream.file.bytes();
        let path = stream.file.path().to_path_buf();
        match stream.file.finish() {
            Ok(path) => info!("the recording is in {}", path.display()),
            Err(error) if remove_if_empty(&path) => warn!("the last part of the recording is lost: {error}"),
            Err(error) => warn!("the recording is not complete: {error}; `hexad recover` completes it"),
        }
    }

    fn write(&mut self, context: &Context, tape: &Tape) -> Result<(), RecordingError> {
        if self.interruption.is_ongoing() && self.stream.is_none() {
            self.count_unwritten(tape.oldest());
        }
        let next_cycle = self.stream.as_ref().map_or(self.unsaved_cycle, |stream| stream.next_cycle);
        for cycle in tape.from(next_cycle) {
            if context.begins_second(cycle.cycle) {
                self.end_second(cycle)?;
            }
            let stream = match &mut self.stream {
                Some(stream) => stream,
                None => self.stream.insert(Self::begin_file(
                    &self.folder,
                    &mut self.files,
                    context,
                    self.unsaved_cycle,
                )?),
            };
            stream.write(context, tape, cycle)?;
        }
        Ok(())
    }

    /// Counts the cycles before `before` that are not on disk, each once. Returns the number of new ones.
    fn count_unwritten(&mut self, before: u64) -> u64 {
        let lost = before.saturating_sub(self.unsaved_cycle.max(self.counted_cycle));
        self.unwritten += lost;
        self.counted_cycle = self.counted_cycle.max(before);
        lost
    }

    /// Marks everything before the cycle as saved, and ends a full file.
    fn end_second(&mut self, cycle: &CycleMessage) -> Result<(), RecordingError> {
        let Some(stream) = &mut self.stream else { return Ok(()) };
        stream.file.flush()?;
        self.unsaved_cycle = cycle.cycle;
        if self.interruption.is_ongoing() {
            let (path, unwritten) = (stream.file.path().display(), self.unwritten);
            let lasted_s = self.interruption.end();
            info!(unwritten, "the recording goes on in {path}: for {lasted_s:.0} s nothing was written");
        }
        if let Some(full) = self.stream.take_if(|stream| stream.file.bytes() >= self.folder.file_bytes()) {
            self.ended_bytes += full.file.bytes();
            full.file.finish()?;
        }
        Ok(())
    }

    fn begin_file(
        folder: &Folder,
        files: &mut u32,
        context: &Context,
        first_cycle: u64,
    ) -> Result<Stream, RecordingError> {
        let path = folder.make_room_for_file(&format!("{:03}", *files + 1));
        let file = RecordingFile::create(&path, &context.info, None)?;
        *files += 1;
        Ok(Stream::new(file, first_cycle))
    }

    fn interrupt(&mut self, error: &RecordingError) {
        if let Some(stream) = self.stream.take() {
            let (path, bytes) = (stream.file.path().to_path_buf(), stream.file.bytes());
            let is_saved = stream.first_cycle < self.unsaved_cycle;
            drop(stream);
            if is_saved {
                self.ended_bytes += bytes;
            } else {
                // Memory still holds everything in this file.
                let _ = fs::remove_file(&path);
                self.files -= 1;
            }
        }
        if self.interruption.note() {
            let free = self.interruption.free_text();
            warn!(
                "the recording is interrupted: {error}, with {free}; it goes on in a new file once there is room"
            );
        }
    }
}
