//! Orders in progress, against snapshots as the I/O thread writes them.

use super::*;

/// An order for a cycle, with its first answer.
fn post_for_cycle(request: Request, word: &RequestWord, deadline_ns: u64) -> (PendingOrder, RequestResult) {
    let (stops_before, cycle_ns) = (overruling_count(word, request), Some(7_000_000));
    let order = Order { request, stops_before, waits: false, is_patient: false, deadline_ns, cycle_ns };
    let mut pending = PendingOrder::post(order, &Snapshot::default(), word, 1000);
    let first = pending.step(&Snapshot::default(), word, 1000);
    (pending, result(&first).unwrap())
}

/// However long it takes until its cycle, also the first of all.
#[test]
fn a_request_for_a_cycle_waits_for_it_and_is_withdrawn_at_its_deadline_or_with_its_client() {
    for request in Request::ALL {
        let deadline_ns = 100 * ANSWER_LIMIT_NS;
        let word = RequestWord::default();
        let (mut pending, first) = post_for_cycle(request, &word, deadline_ns);
        assert_eq!((first, word.load() != 0), (RequestResult::Waiting, true), "{request:?}");
        let waits = snapshot(State::Active, 0, Diagnostic::default());
        assert_eq!(result(&pending.step(&waits, &word, deadline_ns)), None);
        assert_eq!(result(&pending.step(&waits, &word, deadline_ns + 1)), Some(RequestResult::Unanswered));
        assert_eq!(word.load() != 0, is_stop(request), "{request:?}");
        let word = RequestWord::default();
        post_for_cycle(request, &word, deadline_ns).0.cancel(&word);
        assert_eq!(word.load() != 0, is_stop(request), "{request:?}");
    }
}

/// The stop waits for a cycle, and the cycle for the setpoint of a source that waits for this answer.
#[test]
fn a_request_for_a_cycle_does_not_wait_for_a_stop() {
    let word = RequestWord::default();
    let stop = word.post(Request::Stop as u32, 0);
    let (_, first) = post_for_cycle(Request::Engage, &word, u64::MAX);
    assert_eq!((first, Some(word.load())), (RequestResult::Superseded, stop));
    let (_, first) = post_for_cycle(Request::Estop, &word, u64::MAX);
    assert_eq!((first, word.load() != stop.unwrap()), (RequestResult::Waiting, true));
}

/// An order that is asked for now.
fn post(
    request: Request,
    is_patient: bool,
    snapshot: &Snapshot,
    word: &RequestWord,
    now_ns: u64,
) -> PendingOrder {
    let stops_before = overruling_count(word, request);
    let (waits, deadline_ns, cycle_ns) = (true, u64::MAX, None);
    let order = Order { request, stops_before, waits, is_patient, deadline_ns, cycle_ns };
    PendingOrder::post(order, snapshot, word, now_ns)
}

fn snapshot(state: State, answered: u64, refusal: Diagnostic) -> Snapshot {
    let mut snapshot = Snapshot { answered, refusal, time_ns: 1, ..Snapshot::default() };
    snapshot.status.state = state as u32;
    snapshot
}

fn first_cycle() -> Snapshot {
    snapshot(State::Standby, 0, Diagnostic::default())
}

#[test]
fn no_control_begins_before_the_first_cycle_and_a_stop_is_posted_at_once() {
    for request in Request::ALL {
        let word = RequestWord::default();
        let mut pending = post(request, true, &Snapshot::default(), &word, 1000);
        assert_eq!(word.load() == 0, request.can_begin_control(), "{request:?}");
        pending.step(&first_cycle(), &word, 2000);
        assert_ne!(word.load(), 0);
    }
}

fn result(step: &Step) -> Option<RequestResult> {
    match step {
        Step::Wait => None,
        Step::Progress(line) | Step::Answer(line) => Some(line.result),
    }
}

#[test]
fn an_engage_is_accepted_and_then_done() {
    let word = RequestWord::default();
    let mut pending = post(Request::Engage, false, &first_cycle(), &word, 1000);
    let posted = word.load();
    let none = Diagnostic::default();
    assert_eq!(result(&pending.step(&snapshot(State::Standby, 0, none), &word, 2000)), None);
    let accepted = pending.step(&snapshot(State::Engaging, posted, none), &word, 3000);
    assert!(matches!(&accepted, Step::Progress(line) if line.result == RequestResult::Accepted));
    assert_eq!(result(&pending.step(&snapshot(State::Engaging, posted, none), &word, 4000)), None);
    let done = pending.step(&snapshot(State::Active, posted, none), &word, 5000);
    assert_eq!(result(&done), Some(RequestResult::Done));
}

#[test]
fn a_stop_of_another_supersedes_an_engage_and_does_not_wait_for_it() {
    let word = RequestWord::default();
    let mut engage = post(Request::Engage, true, &first_cycle(), &word, 1000);
    let _estop = post(Request::Estop, false, &first_cycle(), &word, 2000);
    let step = engage.step(&snapshot(State::Standby, 0, Diagnostic::default()), &word, 3000);
    assert_eq!(result(&step), Some(RequestResult::Superseded));
    engage.cancel(&word);
    assert_eq!(hexad_client::realtime::request_word::number(word.load()), Request::Estop as u32);
}

#[test]
fn a_stop_that_another_replaces_ends_with_whether_the_platform_is_stopped() {
    let none = Diagnostic::default();
    for (later, state, expected) in [
        (Request::Estop, State::Fault, RequestResult::Done),
        (Request::Clear, State::Off, RequestResult::Failed),
    ] {
        let word = RequestWord::default();
        let mut first = post(Request::Estop, false, &first_cycle(), &word, 1000);
        // The loop has read the word. Before the order is checked, a later request is posted and answered.
        word.set_seen(word.load());
        let _later = post(later, false, &first_cycle(), &word, 2000);
        let step = first.step(&snapshot(state, word.load(), none), &word, 3000);
        assert_eq!(result(&step), Some(expected), "{later:?}");
    }
    // An emergency stop replaces a stop that the loop has not read.
    let word = RequestWord::default();
    let mut stop = post(Request::Stop, false, &first_cycle(), &word, 1000);
    let _estop = post(Request::Estop, false, &first_cycle(), &word, 2000);
    assert_eq!(result(&stop.step(&snapshot(State::Active, 0, none), &word, 3000)), None, "on its way");
    let step = stop.step(&snapshot(State::Fault, word.load(), none), &word, 4000);
    assert!(matches!(&step, Step::Answer(it) if it.result == RequestResult::Failed && it.state == "fault"));
}

#[test]
fn what_the_loop_does_not_answer_is_withdrawn_unless_it_stops() {
    for request in Request::ALL {
        let word = RequestWord::default();
        let mut pending = post(request, false, &first_cycle(), &word, 1000);
        let held = snapshot(State::Active, 0, Diagnostic::default());
        assert_eq!(result(&pending.step(&held, &word, ANSWER_LIMIT_NS)), None);
        let step = pending.step(&held, &word, ANSWER_LIMIT_NS + 1001);
        assert_eq!(result(&step), Some(RequestResult::Unanswered));
        assert_eq!(word.load() != 0, is_stop(request), "{request:?}");
    }
}

/// Also if the stop was answered, and another has engaged in vain, before the order is looked at.
#[test]
fn a_stop_of_another_ends_an_order_that_waits() {
    for stop in [Request::Park, Request::Stop, Request::Off, Request::Estop] {
        let word = RequestWord::default();
        let mut waits = post(Request::Engage, true, &first_cycle(), &word, 0);
        let refused = snapshot(State::Standby, word.load(), DiagnosticCode::NoSetpoint.into());
        assert_eq!(result(&waits.step(&refused, &word, 1000)), Some(RequestResult::Waiting));
        word.set_seen(word.load());
        for later in [stop, Request::Engage] {
            post(later, false, &first_cycle(), &word, 2000);
            word.set_seen(word.load());
        }
        let last = word.load();
        assert_eq!(result(&waits.step(&refused, &word, 3000)), Some(RequestResult::Superseded), "{stop:?}");
        assert_eq!(word.load(), last, "nothing is posted");
        let mut new = post(Request::Engage, true, &first_cycle(), &word, 4000);
        assert_eq!(result(&new.step(&refused, &word, 5000)), None, "an order after the stop counts");
    }
}

#[test]
fn a_patient_order_says_once_why_it_waits_and_tries_again() {
    let word = RequestWord::default();
    let mut pending = post(Request::Engage, true, &first_cycle(), &word, 0);
    let first = word.load();
    let refused = snapshot(State::Standby, first, DiagnosticCode::NoSetpoint.into());
    let step = pending.step(&refused, &word, 1000);
    assert!(
        matches!(&step, Step::Progress(line) if line.result == RequestResult::Waiting
        && line.text == "no setpoint; start a setpoint source, then engage"),
        "{step:?}"
    );
    word.set_seen(first);
    assert_eq!(result(&pending.step(&refused, &word, RETRY_INTERVAL_NS + 2000)), None);
    assert_ne!(word.load(), first);
    let again = snapshot(State::Standby, word.load(), DiagnosticCode::NoSetpoint.into());
    assert_eq!(result(&pending.step(&again, &word, RETRY_INTERVAL_NS + 3000)), None, "the same reason");
    // The last message of a source before a pause.
    word.set_seen(word.load());
    assert_eq!(result(&pending.step(&again, &word, 2 * RETRY_INTERVAL_NS + 4000)), None);
    let old = snapshot(State::Standby, word.load(), DiagnosticCode::SetpointStampInvalid.into());
    let step = pending.step(&old, &word, 2 * RETRY_INTERVAL_NS + 5000);
    assert_eq!(result(&step), Some(RequestResult::Waiting), "{step:?}");
    let fault = snapshot(State::Fault, word.load(), DiagnosticCode::InvalidInState.into());
    let mut impatient = post(Request::Engage, true, &first_cycle(), &word, 0);
    assert_eq!(result(&impatient.step(&fault, &word, 1)), Some(RequestResult::Refused));
}
