//! Inputs of the controller: the newest message of each topic.

use crate::cycle::CycleInput;
use crate::reload::io_parameters::IoParameters;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{
    Bus, LeasedSubscriber, MeasuredMessage, PortError, Rejection, RejectionCounts, SetpointMessage,
};
use hexad_core::control::signals::inputs::{Input, Measurement, Setpoint};

/// Messages kept per topic between two reads. Only the newest is used.
const DEPTH: usize = 8;

/// Subscribers of the daemon, and the input made of their messages.
pub struct Inputs {
    setpoints: LeasedSubscriber<SetpointMessage>,
    measured: LeasedSubscriber<MeasuredMessage>,
    cycle: CycleInput,
}

impl Inputs {
    /// Opens the subscribers. A publisher that is silent for longer than its timeout counts as gone.
    pub fn open(bus: &Bus, parameters: &IoParameters) -> Result<Self, PortError> {
        Ok(Self {
            setpoints: bus.leased_subscriber(DEPTH, parameters.setpoint_ns)?,
            measured: bus.leased_subscriber(DEPTH, parameters.measured_ns)?,
            cycle: CycleInput::default(),
        })
    }

    /// Changes the timeouts.
    pub fn set_timeouts(&mut self, parameters: &IoParameters) {
        self.setpoints.set_silence_timeout_ns(parameters.setpoint_ns);
        self.measured.set_silence_timeout_ns(parameters.measured_ns);
    }

    /// The input for the next cycle.
    pub fn cycle_input(&mut self) -> CycleInput {
        self.cycle.written_ns = monotonic_ns();
        self.cycle
    }

    /// The newest inputs.
    pub fn input(&self) -> &Input {
        &self.cycle.input
    }

    /// Receives the newest message of each topic; true if a measurement is among them. While the platform is under control, no
    /// publisher replaces a living one, and none that was ignored is accepted.
    pub fn receive(&mut self, has_control: bool) -> bool {
        self.receive_setpoint(has_control);
        let measured = self.measured.receive_latest(has_control);
        self.cycle.input.measured_publishers = self.measured.publishers();
        if let Some(message) = &measured {
            self.cycle.input.measurement = Some(message.into());
            self.cycle.measurements = self.measured.subscriber().accepted_or_lost_count();
        }
        measured.is_some()
    }

    /// The next measurement, in order.
    pub fn receive_next_measurement(&mut self, has_control: bool) -> Option<Measurement> {
        let message = self.measured.receive(has_control)?;
        self.cycle.input.measured_publishers = self.measured.publishers();
        Some((&message).into())
    }

    /// Sets the measurement of the next cycle.
    pub fn set_measurement(&mut self, measurement: Measurement) {
        self.cycle.input.measurement = Some(measurement);
        self.cycle.measurements += 1;
    }

    /// Whether the setpoint of an instant has arrived, or none can arrive because the source has left.
    pub fn receive_setpoint_of(&mut self, time_ns: u64, has_control: bool) -> bool {
        // In this order, because the source sends its last message before it leaves.
        let has_left = self.setpoints.subscriber().accepted_or_lost_count() > 0
            && self.setpoints.subscriber().publisher_count() == 0;
        self.receive_setpoint(has_control);
        has_left || self.cycle.input.setpoint.is_some_and(|setpoint| setpoint.time_ns == time_ns)
    }

    fn receive_setpoint(&mut self, has_control: bool) {
        if let Some(message) = self.setpoints.receive_latest(has_control) {
            self.cycle.input.setpoint = Some(Setpoint::from(&message));
        }
        self.cycle.input.setpoint_publishers = self.setpoints.publishers();
    }

    /// The last reasons for rejecting a setpoint and a measurement, if the sender must correct them.
    pub fn last_rejections(&self) -> [Option<Rejection>; 2] {
        [self.setpoints.subscriber().last_rejection(), self.measured.subscriber().last_rejection()]
    }

    /// Numbers of rejected messages on all topics.
    pub fn rejections(&self) -> RejectionCounts {
        self.setpoints.subscriber().rejections() + self.measured.subscriber().rejections()
    }
}
