//! Exchange between the I/O thread and the real-time thread: the newest value each way.

use std::sync::Arc;

use super::event::Event;
use super::triple_buffer::{Reader, Writer, triple_buffer};
use crate::messages::LoopCounters;

/// Input of a cycle as the I/O thread writes it.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleInput<I> {
    /// The release instant in it is not used: the loop sets it.
    pub input: I,
    /// Number of measured messages received since start.
    pub measurements: u64,
    /// When the I/O thread wrote it \[ns\].
    pub written_ns: u64,
}

/// Output of a cycle as the real-time thread writes it.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleOutput<O> {
    /// CLOCK_MONOTONIC instant at which the cycle was due \[ns\].
    pub due_ns: u64,
    /// Instant for which it was computed \[ns\]: `due_ns`, or where measurements release cycles the measurement's.
    pub release_ns: u64,
    /// Output that the cycle computed, to be published.
    pub output: O,
    /// Counters of the loop since start, this cycle included.
    pub counters: LoopCounters,
}

/// The real-time thread's ends.
pub struct RealtimeSide<I, O> {
    /// Reader of the newest input.
    pub inputs: Reader<CycleInput<I>>,
    /// Writer of the output of each cycle.
    pub outputs: Writer<CycleOutput<O>>,
    /// Event by which the I/O thread releases a cycle, with external release.
    pub event: Arc<Event>,
}

/// The I/O thread's ends.
pub struct IoSide<I, O> {
    /// Writer of the newest input.
    pub inputs: Writer<CycleInput<I>>,
    /// Reader of the newest output.
    pub outputs: Reader<CycleOutput<O>>,
    /// Signals new inputs, with external release.
    pub event: Arc<Event>,
}

/// Makes both. Allocates; start-up only.
pub fn exchange<I: Copy + Default, O: Copy + Default>() -> (RealtimeSide<I, O>, IoSide<I, O>) {
    let (inputs_writer, inputs_reader) = triple_buffer(CycleInput::default());
    let (outputs_writer, outputs_reader) = triple_buffer(CycleOutput::default());
    let event = Arc::new(Event::default());
    (
        RealtimeSide { inputs: inputs_reader, outputs: outputs_writer, event: event.clone() },
        IoSide { inputs: inputs_writer, outputs: outputs_reader, event },
    )
}
