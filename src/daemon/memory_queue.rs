//! Memory of the controller on its way from the real-time thread to a recorder that has lost a cycle.
//!
//! The queue holds one memory. The real-time thread copies its memory only where there is room: before the first cycle, and
//! after that once each time the recorder has taken the last copy out.

use heapless::spsc::{Consumer, Producer, Queue};

use crate::control::controller::Memory;

/// Length of the queue; one place of it remains free.
const LENGTH: usize = 2;

/// Memory of the controller before a cycle.
pub struct CycleMemory {
    /// Number of the cycle.
    pub cycle: u64,
    pub memory: Memory,
}

/// Queue of one memory.
pub type MemoryQueue = Queue<CycleMemory, LENGTH>;

/// End of the recorder.
pub type MemoryConsumer<'a> = Consumer<'a, CycleMemory>;

/// End of the real-time thread.
pub struct MemoryProducer<'a> {
    queue: Producer<'a, CycleMemory>,
    /// Number of the last cycle.
    cycle: u64,
}

impl<'a> MemoryProducer<'a> {
    /// Before the first cycle.
    pub fn new(queue: Producer<'a, CycleMemory>) -> Self {
        Self { queue, cycle: 0 }
    }

    /// Counts a cycle, and copies the memory before it if there is room.
    pub fn begin_cycle(&mut self, memory: &Memory) {
        self.cycle += 1;
        // A queue of another length there is not; but it divides by its length, which the compiler has to see.
        if self.queue.capacity() == LENGTH - 1 && self.queue.ready() {
            copy(&mut self.queue, self.cycle, memory);
        }
    }
}

/// Apart, so that the stack of a cycle does not hold a second memory.
#[inline(never)]
fn copy(queue: &mut Producer<'_, CycleMemory>, cycle: u64, memory: &Memory) {
    if queue.capacity() == LENGTH - 1 {
        let _ = queue.enqueue(CycleMemory { cycle, memory: memory.clone() });
    }
}
