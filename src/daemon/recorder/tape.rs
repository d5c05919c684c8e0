//! Tape: the last cycles, with the memory of the controller once a second.

use std::collections::VecDeque;

use hexad_client::messages::CycleMessage;
use hexad_core::control::controller::Memory;

/// Length of the tape \[s\].
const TAPE_S: f64 = 30.0;
/// Bound on the memory of the cycles, all locked \[bytes\]: 30 s at 4 kHz.
const MAX_TAPE_BYTES: usize = 128 << 20;
/// Number of memories kept: one per second, and as many after gaps.
const MEMORIES: usize = 2 * TAPE_S as usize;

/// The last cycles.
pub struct Tape {
    cycles: VecDeque<CycleMessage>,
    capacity: usize,
    /// Memories of the controller, each with the number of the cycle that follows it; 0 in an unused place.
    memories: VecDeque<(u64, Box<Memory>)>,
}

impl Tape {
    /// Allocates all memory and writes to all of it, so that a lack of memory shows at the start. The content
    /// of `memory` is not used.
    pub fn new(rate_hz: f64, memory: &Memory) -> Self {
        let capacity = ((TAPE_S * rate_hz) as usize).clamp(1, MAX_TAPE_BYTES / size_of::<CycleMessage>());
        let mut cycles = VecDeque::from(vec![CycleMessage::default(); capacity]);
        cycles.clear();
        let memories = (0..MEMORIES).map(|_| (0, Box::new(memory.clone()))).collect();
        Self { cycles, capacity, memories }
    }

    /// Adds a cycle, and the memory before it.
    pub fn push(&mut self, cycle: &CycleMessage, memory: Option<&Memory>) {
        if self.cycles.len() == self.capacity {
            self.cycles.pop_front();
        }
        self.cycles.push_back(*cycle);
        let Some(memory) = memory else { return };
        if let Some((_, mut kept)) = self.memories.pop_front() {
            (*kept).clone_from(memory);
            self.memories.push_back((cycle.cycle, kept));
        }
    }

    /// Removes everything.
    pub fn clear(&mut self) {
        self.cycles.clear();
        for (cycle, _) in &mut self.memories {
            *cycle = 0;
        }
    }

    /// Whether the tape has no cycle.
    pub fn is_empty(&self) -> bool {
        self.cycles.is_empty()
    }

    /// Cycles from a number on.
    pub fn from(&self, cycle: u64) -> impl Iterator<Item = &CycleMessage> {
        let begin = self.cycles.partition_point(|kept| kept.cycle < cycle);
        self.cycles.range(begin..)
    }

    /// Memory of the controller before a cycle.
    pub fn memory_before(&self, cycle: u64) -> Option<&Memory> {
        self.memories.iter().find(|(kept, _)| *kept == cycle).map(|(_, memory)| &**memory)
    }

    /// First cycle from which a replay of `from` and later cycles is possible: the last cycle up to it with a
    /// memory, else the first later one, else the oldest cycle kept. 0 if there is none.
    pub fn first_replayable_or_0(&self, from: u64) -> u64 {
        let oldest = self.oldest();
        let with_memory =
            || self.memories.iter().map(|(cycle, _)| *cycle).filter(|cycle| *cycle >= oldest.max(1));
        let before = with_memory().filter(|cycle| *cycle <= from).max();
        before.or_else(|| with_memory().min()).unwrap_or(oldest)
    }

    /// Number of the oldest cycle; 0 if there is none.
    pub fn oldest(&self) -> u64 {
        self.cycles.front().map_or(0, |cycle| cycle.cycle)
    }

    /// Number of the newest cycle; 0 if there is none.
    pub fn newest(&self) -> u64 {
        self.cycles.back().map_or(0, |cycle| cycle.cycle)
    }
}
