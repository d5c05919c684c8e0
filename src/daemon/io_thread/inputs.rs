//! Inputs of the controller: the newest message of each topic, and the pending request.

use crate::cycle::CycleInput;
use crate::reload::io_parameters::IoParameters;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{
    Bus, CommandMessage, LeasedSubscriber, MAX_REQUEST_AGE_NS, MeasuredMessage, PortError, Rejection,
    RejectionCounts, SetpointMessage, Subscriber,
};
use hexad_client::realtime::request_word::RequestWord;
use hexad_core::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad_core::control::signals::state::{MessageId, OperatorRequest, Request};

/// Request of the daemon itself before it ends. No message has this epoch.
const STOP_BEFORE_END: OperatorRequest =
    OperatorRequest { request: Request::Stop, message: MessageId { epoch: 0, sequence: 1 } };

/// Messages kept per topic between two reads. Only the newest is used.
const DEPTH: usize = 8;

/// Largest number of topic requests received in one round, so that a publisher without pauses does not block
/// the thread. It takes a tenth of a period at 1 kHz.
const REQUESTS_PER_ROUND: usize = 256;

/// Subscribers of the daemon, and the input made of their messages.
pub struct Inputs {
    setpoints: LeasedSubscriber<SetpointMessage>,
    measured: LeasedSubscriber<MeasuredMessage>,
    commands: Subscriber<CommandMessage>,
    cycle: CycleInput,
    /// Request word of the last call.
    word: u64,
}

/// Conditions for accepting publishers and requests.
#[derive(Clone, Copy)]
pub struct InputFilter<'a> {
    /// Whether the platform is under control. Then no publisher replaces a living one, and none that was
    /// ignored is accepted.
    pub has_control: bool,
    /// The last request that the controller has carried out or refused.
    pub answered_message: MessageId,
    /// Whether the daemon is to end. Then no request may begin control, and the platform comes to rest.
    pub is_ending: bool,
    /// Counts the requests of the topic.
    pub requests: &'a RequestWord,
    /// The request word. A new word replaces a pending request of the topic, because it is newer or has
    /// precedence.
    pub word: u64,
    /// Instant of the word on the clock of the commands \[ns\]. Earlier requests that may begin control are
    /// dropped.
    pub word_ns: u64,
}

impl Inputs {
    /// Opens the subscribers. A publisher that is silent for longer than its timeout counts as gone.
    pub fn open(bus: &Bus, parameters: &IoParameters) -> Result<Self, PortError> {
        Ok(Self {
            setpoints: bus.leased_subscriber(DEPTH, parameters.setpoint_ns)?,
            measured: bus.leased_subscriber(DEPTH, parameters.measured_ns)?,
            commands: bus.subscriber(usize::MAX)?,
            cycle: CycleInput::default(),
            word: 0,
        })
    }

    /// Changes the timeouts.
    pub fn set_timeouts(&mut self, parameters: &IoParameters) {
        self.setpoints.set_timeout_ns(parameters.setpoint_ns);
        self.measured.set_timeout_ns(parameters.measured_ns);
    }

    /// The input for the next cycle.
    pub fn cycle_input(&mut self) -> CycleInput {
        self.cycle.handed_ns = monotonic_ns();
        self.cycle
    }

    /// The newest inputs.
    pub fn input(&self) -> &Input {
        &self.cycle.input
    }

    /// Receives the newest message of each topic; true if a measurement is among them.
    pub fn receive(&mut self, filter: InputFilter<'_>) -> bool {
        self.receive_requests(monotonic_ns, filter);
        self.receive_setpoint(filter.has_control);
        let measured = self.measured.receive_latest(filter.has_control);
        self.cycle.input.measured_publishers = self.measured.publishers();
        if let Some(message) = &measured {
            self.cycle.input.measurement = Some(message.into());
            self.cycle.measurements = self.measured.received_count();
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
    pub fn has_setpoint_of(&mut self, time_ns: u64, has_control: bool) -> bool {
        // In this order, because the source sends its last message before it leaves.
        let has_left = self.setpoints.received_count() > 0 && self.setpoints.publisher_count() == 0;
        self.receive_setpoint(has_control);
        has_left || self.cycle.input.setpoint.is_some_and(|setpoint| setpoint.time_ns == time_ns)
    }

    fn receive_setpoint(&mut self, has_control: bool) {
        if let Some(message) = self.setpoints.receive_latest(has_control) {
            self.cycle.input.setpoint = Some(Setpoint::from(&message));
        }
        self.cycle.input.setpoint_publishers = self.setpoints.publishers();
    }

    /// Receives requests. Of the unanswered ones, the request of highest precedence is kept. The clock is
    /// read after each message, because this thread may have been held just before it. Each is counted, so that a stop
    /// of the topic also ends what waits for control elsewhere.
    pub fn receive_requests(&mut self, clock: impl Fn() -> u64, filter: InputFilter<'_>) {
        let InputFilter { answered_message, is_ending, word, word_ns, .. } = filter;
        if word != self.word {
            (self.word, self.cycle.input.request) = (word, None);
        }
        let is_pending = |request: &OperatorRequest| request.message != answered_message;
        for _ in 0..REQUESTS_PER_ROUND {
            let Some(message) = self.commands.receive_from_any() else { break };
            let Some(request) = message.request() else { continue };
            filter.requests.count(request.request as u32);
            let is_too_old = clock().abs_diff(message.header.time_ns) > MAX_REQUEST_AGE_NS;
            let is_overtaken = message.header.time_ns < word_ns;
            if request.request.can_begin_control() && (is_ending || is_too_old || is_overtaken) {
                continue;
            }
            let pending = self.cycle.input.request.filter(is_pending);
            if pending.is_none_or(|pending| pending.request <= request.request) {
                self.cycle.input.request = Some(request);
            }
        }
        if is_ending && self.cycle.input.request.filter(is_pending).is_none() {
            self.cycle.input.request = Some(STOP_BEFORE_END);
        }
    }

    /// The last reasons for rejecting a setpoint and a measurement, if the sender must correct them.
    pub fn last_rejections(&self) -> [Option<Rejection>; 2] {
        [self.setpoints.last_rejection(), self.measured.last_rejection()]
    }

    /// Numbers of rejected messages on all topics.
    pub fn rejections(&self) -> RejectionCounts {
        self.setpoints.rejections() + self.measured.rejections() + self.commands.rejections()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_request_of_the_topic_stops_and_does_not_begin_control() {
        let bus = Bus::join(&format!("old-requests-{}", std::process::id())).unwrap();
        let mut inputs =
            Inputs::open(&bus, &IoParameters { setpoint_ns: 1, measured_ns: 1, ..IoParameters::default() })
                .unwrap();
        let mut commands = bus.publisher::<CommandMessage>().unwrap();
        let mut answered_message = MessageId::default();
        for request in Request::ALL {
            for (age_ns, is_old) in [(MAX_REQUEST_AGE_NS, false), (MAX_REQUEST_AGE_NS + 1, true)] {
                let sent_ns = monotonic_ns();
                let message = commands.next_message();
                commands.publish(sent_ns, request.into()).unwrap();
                let filter = InputFilter {
                    has_control: false,
                    answered_message,
                    is_ending: false,
                    requests: &RequestWord::default(),
                    word: 0,
                    word_ns: 0,
                };
                inputs.receive_requests(|| sent_ns + age_ns, filter);
                let found = inputs.input().request.filter(|found| found.message == message);
                let is_accepted = !(is_old && request.can_begin_control());
                let expected = is_accepted.then_some(OperatorRequest { request, message });
                assert_eq!(found, expected, "{request:?} after {age_ns} ns");
                answered_message = found.map_or(answered_message, |found| found.message);
            }
        }
    }

    #[test]
    fn a_request_of_the_topic_from_before_the_word_does_not_begin_control() {
        let bus = Bus::join(&format!("overtaken-requests-{}", std::process::id())).unwrap();
        let mut inputs =
            Inputs::open(&bus, &IoParameters { setpoint_ns: 1, measured_ns: 1, ..IoParameters::default() })
                .unwrap();
        let mut commands = bus.publisher::<CommandMessage>().unwrap();
        for (word, request) in (1..).zip(Request::ALL) {
            for (later_ns, is_overtaken) in [(0, false), (1, true)] {
                let sent_ns = monotonic_ns();
                let message = commands.next_message();
                commands.publish(sent_ns, request.into()).unwrap();
                let word = 2 * word + later_ns;
                let word_ns = sent_ns + later_ns;
                let filter = InputFilter {
                    has_control: false,
                    answered_message: MessageId::default(),
                    is_ending: false,
                    requests: &RequestWord::default(),
                    word,
                    word_ns,
                };
                inputs.receive_requests(|| sent_ns, filter);
                let is_accepted = !(is_overtaken && request.can_begin_control());
                let expected = is_accepted.then_some(OperatorRequest { request, message });
                assert_eq!(inputs.input().request, expected, "{request:?}, the word {later_ns} ns later");
            }
        }
    }
}
