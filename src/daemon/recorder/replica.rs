//! Replica: a controller that repeats every cycle in the recorder.

use tracing::warn;

use hexad_client::messages::CycleMessage;
use hexad_client::messages::layout::Declared as _;
use hexad_core::control::controller::{Controller, Memory};

/// Repeats the cycles of the real-time thread. After a missing cycle it resumes from a memory of that thread.
pub struct Replica {
    controller: Controller,
    pub next_cycle: u64,
    /// Whether its memory equals the real-time thread's before the next cycle.
    pub is_in_step: bool,
    /// Number of cycles not repeated to the bit.
    unrepeated: u64,
}

impl Replica {
    /// Replica with a controller before its first cycle.
    pub fn new(controller: Controller) -> Self {
        Self { controller, next_cycle: 1, is_in_step: true, unrepeated: 0 }
    }

    /// Exchanges the constants, as the real-time thread does.
    pub fn reconfigure(&mut self, mut new: Controller) {
        self.controller.exchange_configuration(&mut new);
    }

    /// Whether it has repeated every cycle to the bit.
    pub fn has_repeated_all(&self) -> bool {
        self.unrepeated == 0
    }

    /// Memory before the next cycle; `None` if it is unknown.
    pub fn memory(&self) -> Option<&Memory> {
        self.is_in_step.then(|| self.controller.memory())
    }

    /// Skips to a cycle. Returns the number of missing cycles.
    pub fn skip_to(&mut self, cycle: u64) -> u64 {
        let missing = cycle.saturating_sub(self.next_cycle);
        if missing > 0 {
            if self.unrepeated == 0 {
                warn!(cycle, missing, "cycles are missing in the recording; the report counts all of them");
            }
            (self.next_cycle, self.is_in_step) = (cycle, false);
            self.unrepeated += missing;
        }
        missing
    }

    /// Resumes from the memory before the next cycle.
    pub fn resume(&mut self, memory: &Memory) {
        self.controller.set_memory(memory.clone());
        self.is_in_step = true;
    }

    /// Repeats the next cycle.
    pub fn step(&mut self, cycle: &CycleMessage) {
        self.next_cycle = cycle.cycle + 1;
        let input = cycle.input().filter(|_| self.is_in_step);
        let repeated = input.map(|input| (input, self.controller.step(&input)));
        let is_equal = repeated.is_some_and(|(input, output)| {
            CycleMessage::new(&input, &output).with_number_and_timing_of(cycle).bytes() == cycle.bytes()
        });
        if is_equal {
            return;
        }
        if self.is_in_step {
            warn!(
                cycle = cycle.cycle,
                "the replica of the controller has another result: report this, with the recording"
            );
        }
        self.is_in_step = false;
        self.unrepeated += 1;
    }
}
