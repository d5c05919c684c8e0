//! Outputs of the controller as messages: force and status of each cycle.

use heapless::spsc::Producer;

use crate::control::controller::Output;
use crate::control::diagnostic::DiagnosticCode;
use crate::control::state::State;
use crate::daemon::cycle::CycleOutput;
use crate::messages::clock::monotonic_ns;
use crate::messages::{Bus, ForceMessage, IoCounters, PortError, Publisher, Statistics, StatusMessage};
use crate::realtime::triple_buffer::Reader;

/// Publishers of the daemon.
pub struct Outputs {
    forces: Publisher<ForceMessage>,
    statuses: Publisher<StatusMessage>,
    is_simulated: bool,
    send_failures: u64,
}

/// What messages need besides the output of the cycle.
#[derive(Clone, Copy)]
pub struct OutputSettings {
    /// Origin of the angles of X.
    pub home: [f64; 6],
    /// Forces computed longer ago are not valid any more: the process was held (stopped, or the host took the processor)
    /// between computing and sending them \[ns\].
    pub max_force_age_ns: u64,
}

impl Outputs {
    /// Opens the publishers.
    pub fn open(bus: &Bus) -> Result<Self, PortError> {
        let (forces, is_simulated) = (bus.publisher()?, bus.is_simulated());
        Ok(Self {
            forces: if is_simulated { forces.with_reproducible_epoch() } else { forces },
            statuses: bus.publisher()?,
            is_simulated,
            send_failures: 0,
        })
    }

    /// Publishes force and status of a cycle, and records the delay from its release to the force sent.
    pub fn publish(
        &mut self,
        settings: &OutputSettings,
        mut cycle: CycleOutput,
        io: IoCounters,
        statistics: &mut Reader<Statistics>,
        delays: &mut Producer<'_, u64>,
    ) {
        if !self.is_simulated {
            let now_ns = monotonic_ns();
            invalidate_if_held(&mut cycle, now_ns, settings.max_force_age_ns);
            self.publish_force(&cycle, now_ns, delays);
            let status = status(settings, &cycle, io, statistics);
            self.send_failures += u64::from(self.statuses.publish(now_ns, status).is_err());
            return;
        }
        // The status first: a source that responds to the next measurement then has the status of this one.
        let status = status(settings, &cycle, io, statistics);
        self.send_failures += u64::from(self.statuses.publish(cycle.release_ns, status).is_err());
        self.publish_force(&cycle, cycle.release_ns, delays);
    }

    /// Messages that could not be sent.
    pub fn send_failures(&self) -> u64 {
        self.send_failures
    }

    fn publish_force(&mut self, cycle: &CycleOutput, time_ns: u64, delays: &mut Producer<'_, u64>) {
        let message = ForceMessage::new(&cycle.output, cycle.release_ns);
        self.send_failures += u64::from(self.forces.publish(time_ns, message).is_err());
        if cycle.output.state.has_control() {
            // Full only if the log thread is held; that loses statistics, not forces.
            let _ = delays.enqueue(monotonic_ns().saturating_sub(cycle.due_ns));
        }
    }
}

fn status(
    settings: &OutputSettings,
    cycle: &CycleOutput,
    io: IoCounters,
    statistics: &mut Reader<Statistics>,
) -> StatusMessage {
    StatusMessage {
        counters: cycle.counters,
        io,
        statistics: *statistics.read(),
        ..StatusMessage::new(&settings.home, &cycle.output)
    }
}

/// The loop finds the same at its next cycle, by the age of its last measurement.
fn invalidate_if_held(cycle: &mut CycleOutput, now_ns: u64, max_force_age_ns: u64) {
    let output = &mut cycle.output;
    if now_ns.saturating_sub(cycle.due_ns) > max_force_age_ns && output.state.has_control() {
        (output.state, output.diagnostic, output.force) =
            (State::Fault, DiagnosticCode::MeasurementLost.into(), Output::default().force);
    }
}
