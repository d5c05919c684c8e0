//! Outputs of the controller as messages: force and status of each cycle, and the statistics.

use heapless::spsc::Producer;

use crate::cycle::CycleOutput;
use crate::reload::io_parameters::IoParameters;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{
    Bus, ForceMessage, IoCounters, PortError, Publisher, StatisticsMessage, StatusMessage,
};
use hexad_core::control::controller::Output;
use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad_core::control::signals::inputs::Setpoint;
use hexad_core::control::signals::state::State;
use hexad_core::control::supervision::in_position::InPosition;

/// Publishers of the daemon.
pub struct Outputs {
    forces: Publisher<ForceMessage>,
    statuses: Publisher<StatusMessage>,
    statistics: Publisher<StatisticsMessage>,
    in_position: InPosition,
    is_simulated: bool,
    /// Number of messages that could not be sent.
    pub send_failures: u64,
}

/// Settings for the messages, besides the output of the cycle.
#[derive(Clone, Copy)]
pub struct OutputSettings {
    /// Origin of the angles of X.
    pub home: [f64; 6],
    /// Parameters in force. `measured_ns` is also the largest age of a valid force: older ones mean that the process was
    /// held between computing and sending them, because it was stopped or the host took the processor.
    pub parameters: IoParameters,
}

impl Outputs {
    /// Opens the publishers.
    pub fn open(bus: &Bus) -> Result<Self, PortError> {
        let (forces, is_simulated) = (bus.publisher()?, bus.is_simulated());
        Ok(Self {
            forces: if is_simulated { forces.with_reproducible_epoch() } else { forces },
            statuses: bus.publisher()?,
            statistics: bus.publisher()?,
            in_position: InPosition::default(),
            is_simulated,
            send_failures: 0,
        })
    }

    /// Publishes force and status of a cycle, and records the delay from its release to the force sent. Returns the status.
    pub fn publish(
        &mut self,
        settings: &OutputSettings,
        mut cycle: CycleOutput,
        setpoint: Option<&Setpoint>,
        io: IoCounters,
        delays: &mut Producer<'_, u64>,
    ) -> StatusMessage {
        if !self.is_simulated {
            let now_ns = monotonic_ns();
            invalidate_if_held(&mut cycle, now_ns, settings.parameters.measured_ns);
            self.publish_force(&cycle, now_ns, delays);
            let status = self.status(settings, &cycle, setpoint, io);
            self.send_failures += u64::from(self.statuses.publish(now_ns, status).is_err());
            return status;
        }
        // The status first. A source that responds to the next measurement then has the status of this cycle.
        let status = self.status(settings, &cycle, setpoint, io);
        self.send_failures += u64::from(self.statuses.publish(cycle.release_ns, status).is_err());
        self.publish_force(&cycle, cycle.release_ns, delays);
        status
    }

    /// Publishes the statistics of the last second, at the time of a cycle in simulated time.
    pub fn publish_statistics(&mut self, statistics: StatisticsMessage, release_ns: u64) {
        let time_ns = if self.is_simulated { release_ns } else { monotonic_ns() };
        self.send_failures += u64::from(self.statistics.publish(time_ns, statistics).is_err());
    }

    fn publish_force(&mut self, cycle: &CycleOutput, time_ns: u64, delays: &mut Producer<'_, u64>) {
        let message = ForceMessage::new(&cycle.output, cycle.release_ns);
        self.send_failures += u64::from(self.forces.publish(time_ns, message).is_err());
        if cycle.output.state.has_control() {
            // The queue is full only if the log thread is held. Then statistics are lost, but no forces.
            let _ = delays.enqueue(monotonic_ns().saturating_sub(cycle.due_ns));
        }
    }

    fn status(
        &mut self,
        settings: &OutputSettings,
        cycle: &CycleOutput,
        setpoint: Option<&Setpoint>,
        io: IoCounters,
    ) -> StatusMessage {
        let OutputSettings { home, parameters } = settings;
        let CycleOutput { output, counters, release_ns, .. } = cycle;
        let message = StatusMessage::new(home, output, setpoint);
        let error = message.setpoint_error().filter(|_| output.state == State::Active);
        let x = setpoint.map_or([f64::NAN; 6], |setpoint| setpoint.task.x.into());
        let in_position = self.in_position.update(&parameters.in_position, *release_ns, &x, error.as_ref());
        let limits_scale = parameters.limits_scale;
        StatusMessage { counters: *counters, io, in_position: in_position.into(), limits_scale, ..message }
    }
}

/// Makes the forces of a held cycle invalid. The loop detects the same at its next cycle, by the age of its
/// last measurement.
fn invalidate_if_held(cycle: &mut CycleOutput, now_ns: u64, max_force_age_ns: u64) {
    let (output, age_ns) = (&mut cycle.output, now_ns.saturating_sub(cycle.due_ns));
    if age_ns > max_force_age_ns && output.state.has_control() {
        let [age_s, bound_s] = [age_ns, max_force_age_ns].map(|time_ns| time_ns as f64 * 1e-9);
        let diagnostic = Diagnostic::new(DiagnosticCode::DaemonHeld, age_s, bound_s);
        (output.state, output.diagnostic, output.command_n) =
            (State::Fault, diagnostic, Output::default().command_n);
    }
}

#[cfg(test)]
mod tests {
    use heapless::spsc::Queue;

    use super::*;

    const DUE_NS: u64 = 7_000_000_000;
    const MAX_AGE_NS: u64 = 20_000_000;

    /// Includes the last output: no other follows while the loop is held.
    #[test]
    fn what_is_published_of_a_held_loop_is_no_valid_force() {
        let bus = Bus::join(&format!("held-loop-{}", std::process::id())).unwrap();
        let mut outputs = Outputs::open(&bus).unwrap();
        let mut forces = bus.subscriber::<ForceMessage>(8).unwrap();
        let mut queue = Queue::<u64, 8>::new();
        let (mut delays, _) = queue.split();
        let output = Output { state: State::Active, command_n: [5.0; 6], ..Output::default() };
        for (max_force_age_ns, is_valid) in [(u64::MAX, true), (0, false)] {
            let parameters = IoParameters { measured_ns: max_force_age_ns, ..IoParameters::default() };
            let settings = OutputSettings { home: [0.0; 6], parameters };
            let cycle = CycleOutput { due_ns: monotonic_ns() - 1000, output, ..CycleOutput::default() };
            let io = IoCounters::default();
            let status = outputs.publish(&settings, cycle, None, io, &mut delays);
            let force = forces.receive_latest().unwrap();
            let (state, sent) = if is_valid { (State::Active, [5.0; 6]) } else { (State::Fault, [0.0; 6]) };
            assert_eq!((force.valid, force.force_n, status.state), (u32::from(is_valid), sent, state as u32));
        }
    }

    #[test]
    fn a_force_that_was_held_too_long_is_a_fault_with_its_age() {
        for state in State::ALL {
            for (age_ns, is_held) in [(MAX_AGE_NS, false), (MAX_AGE_NS + 1_000_000, true)] {
                let output = Output { state, command_n: [5.0; 6], ..Output::default() };
                let mut cycle = CycleOutput { due_ns: DUE_NS, output, ..CycleOutput::default() };
                invalidate_if_held(&mut cycle, DUE_NS + age_ns, MAX_AGE_NS);
                let expected = if is_held && state.has_control() {
                    let diagnostic = Diagnostic::new(DiagnosticCode::DaemonHeld, 0.021, 0.02);
                    Output { state: State::Fault, diagnostic, ..Output::default() }
                } else {
                    output
                };
                assert_eq!(cycle.output, expected, "{state:?} after {age_ns} ns");
            }
        }
    }
}
