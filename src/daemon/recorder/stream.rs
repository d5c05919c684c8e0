//! Stream: a part of the tape that is being written to one file.

use super::Context;
use super::tape::Tape;
use crate::recording::file::RecordingFile;
use crate::recording::{RecordingError, memory_bytes};
use hexad_client::messages::{CycleMessage, GapMessage};

/// Rate of frames and joints \[1/s\].
const SCENES_PER_S: u64 = 100;

/// Part of the tape that is being written to one file.
pub struct Stream {
    pub file: RecordingFile,
    pub first_cycle: u64,
    pub next_cycle: u64,
}

impl Stream {
    /// Begins a file with a cycle. If the first written cycle is later, the file begins with a gap.
    pub fn new(file: RecordingFile, first_cycle: u64) -> Self {
        Self { file, first_cycle, next_cycle: first_cycle }
    }

    /// Writes a cycle with its memory, frames and joints.
    pub fn write(
        &mut self,
        context: &Context,
        tape: &Tape,
        cycle: &CycleMessage,
    ) -> Result<(), RecordingError> {
        let Self { file, next_cycle, .. } = self;
        let missing = cycle.cycle.saturating_sub(*next_cycle);
        if missing > 0 {
            file.write_gap(cycle.due_ns, &GapMessage { first_cycle: *next_cycle, cycles: missing })?;
        }
        if let Some(memory) = tape.memory_before(cycle.cycle) {
            file.write_memory(cycle.cycle, cycle.due_ns, &memory_bytes(memory))?;
        }
        file.write_cycle(cycle)?;
        if cycle.cycle.is_multiple_of((context.rate / SCENES_PER_S).max(1)) {
            file.write_scene(&context.scene, cycle)?;
        }
        *next_cycle = cycle.cycle + 1;
        Ok(())
    }
}
