//! Exchange between the io thread and the real-time thread: the newest value each way.

extern crate std;

use std::sync::Arc;

use crate::control::controller::{Input, Output};
use crate::realtime::cyclic::Counters;
use crate::realtime::event::Event;
use crate::realtime::triple_buffer::{Reader, Writer, triple_buffer};

/// What the io thread hands in.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleInput {
    /// The release in here is not used: the loop knows its own.
    pub input: Input,
    /// Measured messages that came since start.
    pub measurements: u64,
    /// When it was handed in \[ns\].
    pub handed_ns: u64,
}

/// What the real-time thread hands out.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleOutput {
    /// CLOCK_MONOTONIC instant at which the cycle was due \[ns\].
    pub due_ns: u64,
    /// Instant for which it was computed \[ns\]: `due_ns`, or where measurements release cycles the measurement's.
    pub release_ns: u64,
    pub output: Output,
    pub counters: Counters,
}

/// The real-time thread's ends.
pub struct RealtimeSide {
    pub inputs: Reader<CycleInput>,
    pub outputs: Writer<CycleOutput>,
    pub event: Arc<Event>,
}

/// The io thread's ends.
pub struct IoSide {
    pub inputs: Writer<CycleInput>,
    pub outputs: Reader<CycleOutput>,
    /// Signals new inputs, with external release.
    pub event: Arc<Event>,
}

/// Makes both. Allocates; start-up only.
pub fn exchange() -> (RealtimeSide, IoSide) {
    let (inputs_writer, inputs_reader) = triple_buffer(CycleInput::default());
    let (outputs_writer, outputs_reader) = triple_buffer(CycleOutput::default());
    let event = Arc::new(Event::default());
    (
        RealtimeSide { inputs: inputs_reader, outputs: outputs_writer, event: event.clone() },
        IoSide { inputs: inputs_writer, outputs: outputs_reader, event },
    )
}
