//! A controller that repeats every cycle in the recorder.

use tracing::warn;

use crate::control::controller::{Controller, Memory};
use crate::messages::CycleMessage;
use crate::messages::layout::Declared as _;

/// Repeats the cycles of the real-time thread, as long as none is missing.
pub struct Replica {
    controller: Controller,
    next_cycle: u64,
    is_in_step: bool,
}

impl Replica {
    /// Begins with a controller before its first cycle.
    pub fn new(controller: Controller) -> Self {
        Self { controller, next_cycle: 1, is_in_step: true }
    }

    /// Exchanges the constants, as the real-time thread does.
    pub fn reconfigure(&mut self, mut new: Controller) {
        self.controller.exchange_constants(&mut new);
    }

    /// Number of the cycle that follows.
    pub fn next_cycle(&self) -> u64 {
        self.next_cycle
    }

    /// Whether it has repeated every cycle to the bit.
    pub fn is_in_step(&self) -> bool {
        self.is_in_step
    }

    /// Memory before a cycle; `None` if it is unknown.
    pub fn memory_before(&self, cycle: &CycleMessage) -> Option<&Memory> {
        (self.is_in_step && cycle.cycle == self.next_cycle).then(|| self.controller.memory())
    }

    /// Repeats a cycle.
    pub fn step(&mut self, cycle: &CycleMessage) {
        let missing = cycle.cycle.saturating_sub(self.next_cycle);
        self.next_cycle = cycle.cycle + 1;
        if !self.is_in_step {
            return;
        }
        if missing > 0 {
            self.is_in_step = false;
            warn!(
                cycle = cycle.cycle,
                missing, "cycles are missing in the recording: from here on it cannot be replayed"
            );
            return;
        }
        let repeated = cycle.input().map(|input| (input, self.controller.step(&input)));
        let is_equal = repeated.is_some_and(|(input, output)| {
            CycleMessage::new(&input, &output).timed_as(cycle).bytes() == cycle.bytes()
        });
        if !is_equal {
            self.is_in_step = false;
            warn!(
                cycle = cycle.cycle,
                "the replica of the controller has another result: report this, with the recording"
            );
        }
    }
}
