//! The generic cyclic loop with the controller's input and output.

use core::sync::atomic::AtomicBool;

use heapless::spsc::Producer;
use hexad_client::messages::CycleMessage;
use hexad_client::operator::protocol::{MAX_REQUEST_AGE_NS, is_stop};
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
        (input.release_ns, input.had_faulty_overrun) = (release_ns, deadline_missed);
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

/// Epoch of every request; its sequence is the request word.
pub const WORD_EPOCH: u64 = u64::MAX;

/// Intake of requests from the request word, each once.
#[derive(Clone, Copy, Debug, Default)]
pub struct RequestIntake {
    /// The last word processed.
    word: u64,
}

impl RequestIntake {
    /// The request of a cycle that wakes at `woke_ns` and computes for `release_ns`. One that names a later cycle is left until then,
    /// but no stop waits. One that may begin control and is too old is lost.
    #[inline(never)]
    pub fn next(&mut self, word: u64, woke_ns: u64, release_ns: u64) -> Option<OperatorRequest> {
        let request = Request::from_number(request_word::number(word)).filter(|_| word != self.word)?;
        let cycle_ns = request_word::cycle_ns(word);
        if cycle_ns.is_some_and(|cycle_ns| cycle_ns > release_ns) && !is_stop(request) {
            return None;
        }
        self.word = word;
        let now_ns = if cycle_ns.is_some() { release_ns } else { woke_ns };
        let is_too_old = now_ns.saturating_sub(request_word::time_ns(word)) > MAX_REQUEST_AGE_NS;
        let is_lost = request.can_begin_control() && is_too_old;
        let message = MessageId { epoch: WORD_EPOCH, sequence: word };
        (!is_lost).then_some(OperatorRequest { request, message })
    }
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
    const CYCLE_NS: u64 = 2_000_000;

    fn next(intake: &mut RequestIntake, word: u64, release_ns: u64) -> Option<Request> {
        intake.next(word, NOW_NS, release_ns).map(|found| found.request)
    }

    #[test]
    fn a_request_counts_once_and_an_old_one_stops_and_does_not_begin_control() {
        for request in Request::ALL {
            for (age_ns, is_old) in [(MAX_REQUEST_AGE_NS, false), (MAX_REQUEST_AGE_NS + 1_000_000, true)] {
                let word = RequestWord::default().post(request as u32, NOW_NS - age_ns).unwrap();
                let mut intake = RequestIntake::default();
                let is_lost = is_old && request.can_begin_control();
                assert_eq!(next(&mut intake, word, 1), (!is_lost).then_some(request), "{request:?}");
                assert_eq!(next(&mut intake, word, 1), None, "{request:?} again");
            }
        }
        assert_eq!(next(&mut RequestIntake::default(), 0, 1), None);
    }

    /// Whatever the clock says; and a cycle that is long past begins no control.
    #[test]
    fn a_request_acts_in_the_cycle_that_it_names_and_a_stop_does_not_wait() {
        for request in Request::ALL {
            let word = RequestWord::default();
            let word = word.post_unless(request as u32, 1, Some(CYCLE_NS + 333), || false).unwrap();
            let mut intake = RequestIntake::default();
            let early = next(&mut intake, word, CYCLE_NS - 1_000);
            assert_eq!(early, is_stop(request).then_some(request));
            assert_eq!(next(&mut intake, word, CYCLE_NS + 333).or(early), Some(request));
            assert_eq!(next(&mut intake, word, 2 * CYCLE_NS), None, "{request:?} again");
            let late_ns = CYCLE_NS + MAX_REQUEST_AGE_NS + 1_000;
            let late = next(&mut RequestIntake::default(), word, late_ns);
            assert_eq!(late.is_none(), request.can_begin_control(), "{request:?}");
        }
    }
}
