//! Exchange between the io thread and the real-time thread: one wait-free triple buffer each way.
//! The real-time thread never waits; a buffer always holds the newest value.

use triple_buffer::{Input as Writer, Output as Reader};

use crate::control::controller::{Input, Output};
use crate::realtime::cyclic::Counters;

/// What the io thread hands in.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleInput {
    /// The release in here is not used: the loop knows its own.
    pub input: Input,
    /// Measured messages received since start.
    pub measurements: u64,
    /// When it was handed in \[ns\].
    pub handed_ns: u64,
}

/// What the real-time thread hands out.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleOutput {
    /// CLOCK_MONOTONIC instant at which the cycle was due \[ns\].
    pub due_ns: u64,
    /// Instant for which it was computed \[ns\]: `due_ns`, or with external release the measurement's.
    pub release_ns: u64,
    pub output: Output,
    pub counters: Counters,
}

/// The real-time thread's ends.
pub struct RealtimeSide {
    pub inputs: Reader<CycleInput>,
    pub outputs: Writer<CycleOutput>,
}

/// The io thread's ends.
pub struct IoSide {
    pub inputs: Writer<CycleInput>,
    pub outputs: Reader<CycleOutput>,
}

/// Makes both. Allocates; start-up only.
pub fn exchange() -> (RealtimeSide, IoSide) {
    let (inputs_writer, inputs_reader) = triple_buffer::triple_buffer(&CycleInput::default());
    let (outputs_writer, outputs_reader) = triple_buffer::triple_buffer(&CycleOutput::default());
    (
        RealtimeSide { inputs: inputs_reader, outputs: outputs_writer },
        IoSide { inputs: inputs_writer, outputs: outputs_reader },
    )
}
