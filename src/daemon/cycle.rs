//! The generic cyclic loop with the controller's input and output.

use crate::control::controller::{Input, Output};
use crate::control::state::State;
use crate::realtime::cyclic::{self, CyclicInput};
use crate::realtime::exchange;

/// One cycle of the controller, for statistics and log.
pub type CycleRecord = cyclic::CycleRecord<Input, Output>;
/// Input of a cycle, from the I/O thread.
pub type CycleInput = exchange::CycleInput<Input>;
/// Output of a cycle, to the I/O thread.
pub type CycleOutput = exchange::CycleOutput<Output>;
/// The I/O thread's ends of the exchange with the real-time thread.
pub type IoSide = exchange::IoSide<Input, Output>;
/// The real-time thread's ends of the exchange with the I/O thread.
pub type RealtimeSide = exchange::RealtimeSide<Input, Output>;

impl CyclicInput for Input {
    fn begin_cycle(&mut self, release_ns: u64, deadline_missed: bool) {
        (self.release_ns, self.deadline_missed) = (release_ns, deadline_missed);
    }

    fn measured_ns(&self) -> Option<u64> {
        self.measurement.map(|measurement| measurement.time_ns)
    }
}

/// Age of the measurement at the release \[ns\], if there is one.
pub fn measured_age_ns(record: &CycleRecord) -> Option<u64> {
    record.input.measured_ns().map(|time_ns| record.input.release_ns.saturating_sub(time_ns))
}

/// Norms of the tracking error while active \[m\], \[rad\].
pub fn tracking_error(record: &CycleRecord) -> Option<(f64, f64)> {
    let error = record.output.error.filter(|_| record.output.state == State::Active)?;
    Some((error.pose.linear.norm(), error.pose.angular.norm()))
}
