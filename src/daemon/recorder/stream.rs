//! Writes the tape to files: without end, or the window of a fault.

use std::path::PathBuf;

use super::Context;
use super::folder::Folder;
use super::tape::Tape;
use crate::messages::{CycleMessage, GapMessage};
use crate::recording::file::RecordingFile;
use crate::recording::{RecordingError, memory_bytes};

/// Frames and joints in a second.
const SCENES_PER_S: u64 = 100;

/// Part of the tape on its way to disk.
pub struct Stream {
    file: Option<RecordingFile>,
    /// Of files without end; they follow each other.
    folder: Option<Folder>,
    files: u32,
    /// Bytes in files that are complete.
    complete_bytes: u64,
    next_cycle: u64,
    /// The last cycle.
    end: u64,
}

impl Stream {
    /// Every cycle, from the first.
    pub fn recording(folder: Folder) -> Self {
        Self { file: None, folder: Some(folder), files: 0, complete_bytes: 0, next_cycle: 1, end: u64::MAX }
    }

    /// What the tape holds, for the fault of a code in a cycle.
    pub fn window(
        folder: &Folder,
        context: &Context,
        tape: &Tape,
        code: u32,
        fault: u64,
    ) -> Result<Self, RecordingError> {
        let path = folder.next_path(&format!("fault-{code}-cycle-{fault}"));
        let file = Some(RecordingFile::create(&path, &context.info, Some(fault))?);
        let (next_cycle, end) = (tape.first_repeatable(), tape.newest());
        Ok(Self { file, folder: None, files: 1, complete_bytes: 0, next_cycle, end })
    }

    /// Bytes written.
    pub fn bytes(&self) -> u64 {
        self.complete_bytes + self.file.as_ref().map_or(0, RecordingFile::bytes)
    }

    /// Writes at most so many cycles; whether the last one is written.
    pub fn advance(&mut self, context: &Context, tape: &Tape, most: usize) -> Result<bool, RecordingError> {
        let end = self.end;
        for cycle in tape.from(self.next_cycle).take_while(|cycle| cycle.cycle <= end).take(most) {
            self.write(context, tape, cycle)?;
        }
        Ok(self.next_cycle > self.end)
    }

    /// Completes the file; the next cycle begins another.
    pub fn end_file(&mut self) -> Result<(), RecordingError> {
        let Some(file) = self.file.take() else { return Ok(()) };
        self.complete_bytes += file.bytes();
        file.finish().map(drop)
    }

    /// Completes the file.
    pub fn finish(self) -> Result<Option<PathBuf>, RecordingError> {
        self.file.map(RecordingFile::finish).transpose()
    }

    fn write(&mut self, context: &Context, tape: &Tape, cycle: &CycleMessage) -> Result<(), RecordingError> {
        let begins_second = (cycle.cycle - 1).is_multiple_of(context.rate);
        let is_full =
            |folder: &Folder| self.file.as_ref().is_some_and(|it| it.bytes() >= folder.file_bytes());
        if begins_second && self.folder.as_ref().is_some_and(is_full) {
            self.end_file()?;
        }
        if let Some(folder) = self.folder.as_ref().filter(|_| self.file.is_none()) {
            self.files += 1;
            let path = folder.next_path(&format!("{:03}", self.files));
            self.file = Some(RecordingFile::create(&path, &context.info, None)?);
        }
        let Some(file) = &mut self.file else { return Ok(()) };
        let missing = cycle.cycle.saturating_sub(self.next_cycle);
        if missing > 0 {
            file.write_gap(cycle.due_ns, &GapMessage { first_cycle: self.next_cycle, cycles: missing })?;
        }
        if let Some(memory) = tape.memory_before(cycle.cycle) {
            file.write_memory(cycle.cycle, cycle.due_ns, &memory_bytes(memory))?;
        }
        file.write_cycle(cycle)?;
        if cycle.cycle.is_multiple_of((context.rate / SCENES_PER_S).max(1)) {
            file.write_scene(&context.scene, cycle)?;
        }
        self.next_cycle = cycle.cycle + 1;
        Ok(())
    }
}
