//! Queue for the controller's memory, from the real-time thread to a recorder that has lost a cycle.
//!
//! The queue holds one memory. The real-time thread copies its memory if there is room: before the first
//! cycle, and once after the recorder has taken the last copy.

use heapless::spsc::{Consumer, Producer, Queue};

use hexad_core::control::controller::Memory;

/// Length of the queue; one place always remains free.
const LENGTH: usize = 2;

/// Memory of the controller before a cycle.
pub struct CycleMemory {
    /// Number of the cycle.
    pub cycle: u64,
    pub memory: Memory,
}

/// Queue of one memory.
pub type MemoryQueue = Queue<CycleMemory, LENGTH>;

/// Recorder's end of the queue.
pub type MemoryConsumer<'a> = Consumer<'a, CycleMemory>;

/// Real-time thread's end of the queue.
pub struct MemoryProducer<'a> {
    queue: Producer<'a, CycleMemory>,
    /// Number of the last cycle.
    cycle: u64,
}

impl<'a> MemoryProducer<'a> {
    /// Producer before the first cycle.
    pub fn new(queue: Producer<'a, CycleMemory>) -> Self {
        Self { queue, cycle: 0 }
    }

    /// Counts a cycle. Copies the memory before the cycle if there is room.
    pub fn begin_cycle(&mut self, memory: &Memory) {
        self.cycle += 1;
        // Always true, but the queue divides by its length, and the compiler must see that it is not zero.
        if self.queue.capacity() == LENGTH - 1 && self.queue.ready() {
            copy(&mut self.queue, self.cycle, memory);
        }
    }
}

/// A separate function, so that the stack of a cycle does not hold a second memory.
#[inline(never)]
fn copy(queue: &mut Producer<'_, CycleMemory>, cycle: u64, memory: &Memory) {
    if queue.capacity() == LENGTH - 1 {
        let _ = queue.enqueue(CycleMemory { cycle, memory: memory.clone() });
    }
}
