//! The generic cyclic loop with the controller's input and output.

use core::sync::atomic::AtomicBool;

use heapless::spsc::Producer;
use hexad_client::messages::{CycleMessage, MAX_REQUEST_AGE_NS};
use hexad_client::realtime::clock::Clock;
use hexad_client::realtime::cyclic::{self, CyclicTask, LoopReport, Release, Timing};
use hexad_client::realtime::exchange;
use hexad_client::realtime::request_word;
use hexad_core::control::controller::Output;
use hexad_core::control::signals::inputs::Input;
use hexad_core::control::signals::state::{MessageId, OperatorRequest, Request, State};

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

/// The controller's step as the task of the loop: it is called with the input, to which it may add, and with the instant at
/// which the cycle woke \[ns\].
struct ControllerTask<S>(S);

impl<S: FnMut(&mut Input, u64) -> Output> CyclicTask for ControllerTask<S> {
    type Input = Input;
    type Output = Output;

    fn measured_ns(input: &Input) -> Option<u64> {
        input.measurement.map(|measurement| measurement.time_ns)
    }

    fn run_cycle(&mut self, input: &mut Input, release: &Release) -> Output {
        let Release { release_ns, clock_ns, woke_ns, deadline_missed } = *release;
        (input.release_ns, input.overrun_is_fault) = (release_ns, deadline_missed);
        input.clock_offset_ns = release_ns.wrapping_sub(clock_ns) as i64;
        (self.0)(input, woke_ns)
    }
}

/// [`cyclic::run`] with the step of a controller. A test may burn time in it.
pub fn run(
    clock: &mut impl Clock,
    timing: &Timing,
    step: impl FnMut(&mut Input, u64) -> Output,
    last: Output,
    side: RealtimeSide,
    records: Producer<'_, CycleRecord>,
    stop: &AtomicBool,
) -> LoopReport {
    cyclic::run(clock, timing, ControllerTask(step), last, side, records, stop)
}

/// Epoch of a request from the control socket or a signal; no publisher has it. The sequence of the request
/// is the request word.
pub const WORD_EPOCH: u64 = u64::MAX;

/// Intake of requests: from the request word or from the command topic, each once.
#[derive(Clone, Copy, Debug, Default)]
pub struct RequestIntake {
    /// The last word processed.
    word: u64,
    /// The last message of the command topic processed.
    message: MessageId,
    /// Longest pause between two cycles after which a request of the topic may begin control \[ns\]. After a
    /// longer one, the request may be from before the pause. 0: no bound, in simulated time.
    longest_cycle_gap_ns: u64,
    /// Wake-up of the last cycle \[ns\].
    woke_ns: u64,
}

impl RequestIntake {
    /// Intake of a real-time thread, in real or simulated time.
    pub fn new(is_simulated: bool) -> Self {
        let longest_cycle_gap_ns = if is_simulated { 0 } else { MAX_REQUEST_AGE_NS };
        Self { longest_cycle_gap_ns, ..Self::default() }
    }

    /// The request of a cycle that wakes at `now_ns`. Of two new requests, the one of higher precedence is
    /// returned; of two equal ones, the word. The other is lost if it may begin control or comes from the
    /// topic. A stop in the word is returned in the next cycle.
    #[inline(never)]
    pub fn next(
        &mut self,
        from_topic: Option<OperatorRequest>,
        word: u64,
        now_ns: u64,
    ) -> Option<OperatorRequest> {
        let from_topic = from_topic.filter(|request| request.message != self.message);
        if let Some(request) = &from_topic {
            self.message = request.message;
        }
        let pause_ns = now_ns.saturating_sub(core::mem::replace(&mut self.woke_ns, now_ns));
        let was_held = self.longest_cycle_gap_ns > 0 && pause_ns > self.longest_cycle_gap_ns;
        let from_topic = from_topic.filter(|topic| !(was_held && topic.request.can_begin_control()));
        let from_word = if word == self.word { None } else { of_word(word, now_ns) };
        match (from_topic, from_word) {
            (Some(topic), Some(new)) if topic.request > new.request => {
                if new.request.can_begin_control() {
                    self.word = word;
                }
                Some(topic)
            }
            (topic, new) => {
                self.word = word;
                new.or(topic)
            }
        }
    }
}

/// The request of a word; `None` if there is none, or if it may begin control and is too old.
pub fn of_word(word: u64, now_ns: u64) -> Option<OperatorRequest> {
    let request = Request::from_number(request_word::number(word))?;
    let is_too_old = now_ns.saturating_sub(request_word::time_ns(word)) > MAX_REQUEST_AGE_NS;
    let is_lost = request.can_begin_control() && is_too_old;
    (!is_lost)
        .then_some(OperatorRequest { request, message: MessageId { epoch: WORD_EPOCH, sequence: word } })
}

/// Message of a cycle, as in a recording.
pub fn message(record: &CycleRecord) -> CycleMessage {
    let CycleRecord { cycle, due_ns, wakeup_ns, compute_ns, io_late, ref input, ref output } = *record;
    let io_late = u32::from(io_late);
    CycleMessage { cycle, due_ns, wakeup_ns, compute_ns, io_late, ..CycleMessage::new(input, output) }
}

/// Age of the measurement at the release \[ns\], if there is one.
pub fn measured_age_ns(record: &CycleRecord) -> Option<u64> {
    record.input.measurement.map(|measured| record.input.release_ns.saturating_sub(measured.time_ns))
}

/// Norms of the tracking error while active \[m\], \[rad\].
pub fn tracking_error(record: &CycleRecord) -> Option<(f64, f64)> {
    let error = record.output.error.filter(|_| record.output.state == State::Active)?;
    Some((error.pose.linear.norm(), error.pose.angular.norm()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_client::realtime::request_word::RequestWord;

    const NOW_NS: u64 = 5_000_000_000;

    fn word(request: Request, age_ns: u64) -> u64 {
        RequestWord::default().post(request as u32, NOW_NS - age_ns).unwrap()
    }

    fn topic(request: Request, sequence: u64) -> Option<OperatorRequest> {
        Some(OperatorRequest { request, message: MessageId { epoch: 7, sequence } })
    }

    fn chosen(intake: &mut RequestIntake, from_topic: Option<OperatorRequest>, word: u64) -> Option<Request> {
        intake.next(from_topic, word, NOW_NS).map(|request| request.request)
    }

    #[test]
    fn each_request_counts_once_also_one_of_the_topic_behind_a_word() {
        let mut intake = RequestIntake::default();
        let engage = topic(Request::Engage, 1);
        assert_eq!(chosen(&mut intake, engage, 0), Some(Request::Engage));
        assert_eq!(chosen(&mut intake, engage, 0), None);
        let off = word(Request::Off, 0);
        assert_eq!(chosen(&mut intake, engage, off), Some(Request::Off));
        assert_eq!(chosen(&mut intake, engage, off), None, "an old engage must not follow an off");
        // A request of the same cycle is lost.
        let estop = word(Request::Estop, 0);
        assert_eq!(chosen(&mut intake, topic(Request::Engage, 2), estop), Some(Request::Estop));
        assert_eq!(chosen(&mut intake, topic(Request::Engage, 2), estop), None);
    }

    #[test]
    fn a_stop_in_the_word_outlives_a_higher_request_and_an_engage_does_not() {
        let mut intake = RequestIntake::default();
        let stop = word(Request::Stop, 0);
        assert_eq!(chosen(&mut intake, topic(Request::Off, 1), stop), Some(Request::Off));
        assert_eq!(chosen(&mut intake, topic(Request::Off, 1), stop), Some(Request::Stop));
        let engage = word(Request::Engage, 1000);
        assert_eq!(chosen(&mut intake, topic(Request::Off, 2), engage), Some(Request::Off));
        assert_eq!(chosen(&mut intake, topic(Request::Off, 2), engage), None);
    }

    #[test]
    fn behind_a_pause_a_request_of_the_topic_stops_and_does_not_begin_control() {
        for (is_simulated, pause_ns, is_held) in [
            (false, MAX_REQUEST_AGE_NS, false),
            (false, MAX_REQUEST_AGE_NS + 1, true),
            (true, 60 * MAX_REQUEST_AGE_NS, false),
        ] {
            for request in Request::ALL {
                let mut intake = RequestIntake::new(is_simulated);
                intake.next(None, 0, NOW_NS);
                let now_ns = NOW_NS + pause_ns;
                let found = intake.next(topic(request, 1), 0, now_ns);
                let is_lost = is_held && request.can_begin_control();
                assert_eq!(found.is_none(), is_lost, "{request:?} {is_simulated} {pause_ns}");
                assert_eq!(intake.next(topic(request, 1), 0, now_ns + 1), None, "nor later");
            }
        }
    }

    #[test]
    fn an_old_word_stops_and_does_not_begin_control() {
        for request in Request::ALL {
            let old = of_word(word(request, MAX_REQUEST_AGE_NS + 1_000_000), NOW_NS);
            assert_eq!(old.is_none(), request.can_begin_control(), "{request:?}");
            assert_eq!(of_word(word(request, 0), NOW_NS).map(|found| found.request), Some(request));
        }
        assert_eq!(of_word(0, NOW_NS), None);
    }
}
