//! The last cycles, with the memory of the controller once a second.

use std::collections::VecDeque;

use crate::control::controller::Memory;
use crate::messages::CycleMessage;

/// Cycles kept \[s\].
const TAPE_S: f64 = 30.0;
/// Bound on their memory, all of it locked \[bytes\]: 30 s at 4 kHz.
const MAX_TAPE_BYTES: usize = 128 << 20;
/// Memories kept: one a second.
const MEMORIES: usize = TAPE_S as usize;

/// The last cycles.
pub struct Tape {
    cycles: VecDeque<CycleMessage>,
    capacity: usize,
    /// Each with the cycle before which the controller had it.
    memories: VecDeque<(u64, Box<Memory>)>,
}

impl Tape {
    /// Allocates all memory but that of the memories.
    pub fn new(rate_hz: f64) -> Self {
        let capacity = ((TAPE_S * rate_hz) as usize).clamp(1, MAX_TAPE_BYTES / size_of::<CycleMessage>());
        Self {
            cycles: VecDeque::with_capacity(capacity),
            capacity,
            memories: VecDeque::with_capacity(MEMORIES),
        }
    }

    /// Adds a cycle, with the memory before it.
    pub fn push(&mut self, cycle: &CycleMessage, memory: Option<&Memory>) {
        if self.cycles.len() == self.capacity {
            self.cycles.pop_front();
        }
        self.cycles.push_back(*cycle);
        let Some(memory) = memory else { return };
        let oldest = if self.memories.len() == MEMORIES { self.memories.pop_front() } else { None };
        let mut kept = oldest.map_or_else(|| Box::new(memory.clone()), |(_, kept)| kept);
        (*kept).clone_from(memory);
        self.memories.push_back((cycle.cycle, kept));
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.cycles.clear();
        self.memories.clear();
    }

    /// Whether there is no cycle.
    pub fn is_empty(&self) -> bool {
        self.cycles.is_empty()
    }

    /// Cycles from a number on.
    pub fn from(&self, cycle: u64) -> impl Iterator<Item = &CycleMessage> {
        let begin = self.cycles.partition_point(|kept| kept.cycle < cycle);
        self.cycles.range(begin..)
    }

    /// The memory of the controller before a cycle.
    pub fn memory_before(&self, cycle: u64) -> Option<&Memory> {
        self.memories.iter().find(|(kept, _)| *kept == cycle).map(|(_, memory)| &**memory)
    }

    /// The first cycle from which on a replay is possible; the oldest if none is.
    pub fn first_repeatable(&self) -> u64 {
        let oldest = self.cycles.front().map_or(1, |cycle| cycle.cycle);
        self.memories.iter().map(|(cycle, _)| *cycle).find(|cycle| *cycle >= oldest).unwrap_or(oldest)
    }

    /// Number of the newest cycle.
    pub fn newest(&self) -> u64 {
        self.cycles.back().map_or(0, |cycle| cycle.cycle)
    }
}
