//! Progress of one request: posted, answered by the controller, completed.

use nalgebra::Vector3;

use crate::process_names::sentence;
use crate::snapshot::Snapshot;
use hexad_client::operator::protocol::{AnswerLine, MAX_REQUEST_AGE_NS, RequestResult, STOPPED, is_stop};
use hexad_client::realtime::request_word::RequestWord;
use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad_core::control::signals::state::{Request, State};

/// Why a request has ended.
pub const REPLACED: &str = "a later request has replaced it";
/// Why a request of a cycle is not posted. Nothing can wait for it: the cycle waits for a setpoint, which waits for the request.
const NOT_POSTED: &str = "a stop, or another request of higher precedence, is about to be obeyed";

/// Interval between two attempts of a request that waits until it is possible \[ns\].
const RETRY_INTERVAL_NS: u64 = 100_000_000;

/// Longest wait for the controller's answer \[ns\]. A request for control is not valid for longer.
const ANSWER_LIMIT_NS: u64 = MAX_REQUEST_AGE_NS + 200_000_000;

/// How often a request was posted that overrules this one: of those that end control, the ones of higher precedence.
pub fn overruling_count(word: &RequestWord, request: Request) -> u32 {
    word.posts_of_higher_precedence(request.max(Request::Clear) as u32)
}

/// Request of a client, with its options.
#[derive(Clone, Copy, Debug)]
pub struct Order {
    pub request: Request,
    /// [`overruling_count`] when it was asked for.
    pub stops_before: u32,
    /// Whether the client is answered only when the request is completed.
    pub waits: bool,
    /// Whether to wait for missing measurements and setpoints instead of being refused.
    pub is_patient: bool,
    /// Instant at which all waiting ends \[ns\].
    pub deadline_ns: u64,
    /// Instant of the cycle that it names, in simulated time \[ns\].
    pub cycle_ns: Option<u64>,
}

/// An order in progress.
#[derive(Clone, Copy, Debug)]
pub struct PendingOrder {
    order: Order,
    stage: Stage,
    /// Beginning of the stage \[ns\].
    since_ns: u64,
    /// The last diagnostic sent to the client.
    reported: DiagnosticCode,
    /// The cycle that the client does not know to be posted yet.
    unreported_cycle_ns: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Not posted yet: a request of higher precedence is pending, or no cycle has run.
    Posting,
    /// This word is posted and not answered yet.
    Posted(u64),
    /// The controller has refused it, and it will be posted again.
    Retrying,
    /// The controller has accepted it.
    Accepted,
    /// A later request has replaced a stop. The state shows whether the platform has stopped.
    Replaced,
}

/// Result of a check of a pending order.
#[derive(Debug)]
pub enum Step {
    /// Nothing has changed.
    Wait,
    /// A line of progress for the client.
    Progress(AnswerLine),
    /// The order has ended.
    Answer(AnswerLine),
}

impl PendingOrder {
    /// Creates an order and posts it at once, unless a request of higher precedence is pending.
    pub fn post(order: Order, snapshot: &Snapshot, word: &RequestWord, now_ns: u64) -> Self {
        let (reported, unreported_cycle_ns) = (DiagnosticCode::None, order.cycle_ns);
        let stage = Stage::Posting;
        let mut pending = Self { order, stage, since_ns: now_ns, reported, unreported_cycle_ns };
        pending.try_post(snapshot, word, now_ns);
        pending
    }

    /// The request.
    pub fn request(&self) -> Request {
        self.order.request
    }

    /// Checks the newest cycle.
    pub fn step(&mut self, snapshot: &Snapshot, word: &RequestWord, now_ns: u64) -> Step {
        let age_ns = now_ns.saturating_sub(self.since_ns);
        let is_late = match self.order.cycle_ns {
            Some(_) => now_ns > self.order.deadline_ns,
            None => age_ns > ANSWER_LIMIT_NS,
        };
        if let Some(cycle_ns) = self.unreported_cycle_ns.take() {
            return match self.stage {
                Stage::Posting => self.answer(RequestResult::Superseded, snapshot, NOT_POSTED.into()),
                _ => {
                    let text = format!("posted for the cycle at {cycle_ns} ns");
                    Step::Progress(self.line(RequestResult::Waiting, snapshot, snapshot.diagnostic(), text))
                }
            };
        }
        match self.stage {
            Stage::Posting if age_ns > ANSWER_LIMIT_NS && !self.order.is_patient => {
                return self.unanswered(snapshot);
            }
            // Whoever stops a platform has also stopped what waits to move it.
            Stage::Posting | Stage::Retrying if self.is_overruled(word) => {
                return self.answer(RequestResult::Superseded, snapshot, STOPPED.into());
            }
            Stage::Posting => self.try_post(snapshot, word, now_ns),
            Stage::Retrying if age_ns > RETRY_INTERVAL_NS => self.try_post(snapshot, word, now_ns),
            Stage::Posted(posted) if posted == snapshot.answered => return self.answered(snapshot, now_ns),
            Stage::Posted(posted) if word.load() != posted && is_stop(self.order.request) => {
                (self.stage, self.since_ns) = (Stage::Replaced, now_ns);
                return self.replaced(snapshot, now_ns);
            }
            Stage::Posted(posted) if word.load() != posted => {
                let text = if self.is_overruled(word) { STOPPED } else { REPLACED };
                return self.answer(RequestResult::Superseded, snapshot, text.into());
            }
            Stage::Posted(posted) if is_late => {
                self.cancel_posted(posted, word);
                return self.unanswered(snapshot);
            }
            Stage::Accepted => return self.completion(snapshot, now_ns),
            Stage::Replaced => return self.replaced(snapshot, now_ns),
            Stage::Posted(_) | Stage::Retrying => {}
        }
        self.check_deadline(snapshot, now_ns)
    }

    /// Withdraws a request that the controller has not read, because its sender has left. A stop remains.
    pub fn cancel(&self, word: &RequestWord) {
        if let Stage::Posted(posted) = self.stage {
            self.cancel_posted(posted, word);
        }
    }

    /// Answer to the client whose order a later request replaces.
    pub fn superseded(&self, snapshot: &Snapshot) -> AnswerLine {
        self.line(RequestResult::Superseded, snapshot, snapshot.diagnostic(), REPLACED.into())
    }

    /// Tries to post the request. Before the first cycle is published, no request for control is posted that names none.
    fn try_post(&mut self, snapshot: &Snapshot, word: &RequestWord, now_ns: u64) {
        let Order { request, cycle_ns, .. } = self.order;
        if snapshot.time_ns == 0 && cycle_ns.is_none() && request.can_begin_control() {
            return;
        }
        let posted = word.post_unless(request as u32, now_ns, cycle_ns, || self.is_overruled(word));
        if let Some(posted) = posted {
            (self.stage, self.since_ns) = (Stage::Posted(posted), now_ns);
        }
    }

    /// Whether a request that ends control was posted since it was asked for.
    fn is_overruled(&self, word: &RequestWord) -> bool {
        let Order { request, stops_before, .. } = self.order;
        !is_stop(request) && stops_before != overruling_count(word, request)
    }

    fn cancel_posted(&self, posted: u64, word: &RequestWord) {
        if !is_stop(self.order.request) {
            word.withdraw(posted);
        }
    }

    /// Evaluates the controller's answer.
    fn answered(&mut self, snapshot: &Snapshot, now_ns: u64) -> Step {
        let refusal = snapshot.refusal;
        if refusal.code == DiagnosticCode::None {
            self.stage = Stage::Accepted;
            let text = "accepted".into();
            return match self.completion(snapshot, now_ns) {
                Step::Wait if self.order.waits => {
                    Step::Progress(self.line(RequestResult::Accepted, snapshot, snapshot.diagnostic(), text))
                }
                Step::Wait => self.answer(RequestResult::Accepted, snapshot, text),
                step => step,
            };
        }
        let text = refusal_text(snapshot);
        // A fault ends only by an operator, so waiting does not help.
        if self.order.is_patient && may_resolve(refusal.code) && snapshot.state() != State::Fault {
            // The cycle that it named has passed.
            (self.stage, self.since_ns, self.order.cycle_ns) = (Stage::Retrying, now_ns, None);
            if self.reported == refusal.code || now_ns > self.order.deadline_ns {
                return self.check_deadline(snapshot, now_ns);
            }
            self.reported = refusal.code;
            return Step::Progress(self.line(RequestResult::Waiting, snapshot, refusal, text));
        }
        Step::Answer(self.line(RequestResult::Refused, snapshot, refusal, text))
    }

    /// Checks whether the state that the accepted request leads to is reached.
    fn completion(&self, snapshot: &Snapshot, now_ns: u64) -> Step {
        match outcome(self.order.request, snapshot.state()) {
            Some(true) => self.answer(RequestResult::Done, snapshot, snapshot.state().name().into()),
            Some(false) => self.answer(RequestResult::Failed, snapshot, state_text(snapshot)),
            None => self.check_deadline(snapshot, now_ns),
        }
    }

    /// Checks a replaced stop. The real-time thread may not have read the replacing request yet.
    fn replaced(&self, snapshot: &Snapshot, now_ns: u64) -> Step {
        let is_new = now_ns.saturating_sub(self.since_ns) <= ANSWER_LIMIT_NS;
        if is_new && snapshot.state().has_control() {
            return self.check_deadline(snapshot, now_ns);
        }
        self.completion(snapshot, now_ns)
    }

    fn check_deadline(&self, snapshot: &Snapshot, now_ns: u64) -> Step {
        if now_ns > self.order.deadline_ns {
            return self.answer(RequestResult::TimedOut, snapshot, state_text(snapshot));
        }
        Step::Wait
    }

    fn unanswered(&self, snapshot: &Snapshot) -> Step {
        let text = if is_stop(self.order.request) {
            "the control loop runs no cycle; the request remains posted until it does"
        } else {
            "the control loop runs no cycle; the request was withdrawn"
        };
        self.answer(RequestResult::Unanswered, snapshot, text.into())
    }

    fn answer(&self, result: RequestResult, snapshot: &Snapshot, text: String) -> Step {
        Step::Answer(self.line(result, snapshot, snapshot.diagnostic(), text))
    }

    fn line(
        &self,
        result: RequestResult,
        snapshot: &Snapshot,
        diagnostic: Diagnostic,
        text: String,
    ) -> AnswerLine {
        snapshot.answer(result, self.order.request.name(), diagnostic, text)
    }
}

/// Whether a state is the result of an accepted request; `None` while it is on the way.
fn outcome(request: Request, state: State) -> Option<bool> {
    match (request, state) {
        (Request::Engage, State::Engaging) => None,
        (Request::Engage, state) => Some(state == State::Active),
        (Request::Stop | Request::Park, State::Stopping) | (Request::Park, State::Parking) => None,
        (Request::Stop, state) => Some(!state.has_control() && state != State::Fault),
        (Request::Park, state) => Some(state == State::Off),
        // A fault remains a fault; it has no force either.
        (Request::Off, state) => Some(!state.has_control()),
        (Request::Clear, state) => Some(state != State::Fault),
        (Request::Estop, state) => Some(state == State::Fault),
    }
}

/// Whether the reason of a refusal may disappear without a correction. A lost source may return; until then,
/// its last message has an old time stamp.
fn may_resolve(code: DiagnosticCode) -> bool {
    use DiagnosticCode::{MeasurementLost, MeasurementStampInvalid, SetpointLost, SetpointStampInvalid};
    let may_return = [MeasurementLost, MeasurementStampInvalid, SetpointLost, SetpointStampInvalid];
    // Only an operator or an external pose selects the assembly mode.
    !code.is_fault() && code != DiagnosticCode::OtherPoses || may_return.contains(&code)
}

fn state_text(snapshot: &Snapshot) -> String {
    format!("the daemon is in {}: {}", snapshot.state().name(), sentence(&snapshot.diagnostic()))
}

/// Text of the last refusal, with what an operator must correct.
fn refusal_text(snapshot: &Snapshot) -> String {
    let Snapshot { status, refusal, .. } = snapshot;
    let norm = |v: [f64; 3]| Vector3::from(v).norm();
    match (refusal.code, snapshot.state()) {
        (DiagnosticCode::InvalidInState, State::Fault) => {
            format!("not possible in state fault ({}); hexad clear first", snapshot.diagnostic().code.name())
        }
        (DiagnosticCode::InvalidInState, state) => format!("not possible in state {}", state.name()),
        (DiagnosticCode::SetpointTooFar, _) if status.error_valid == 1 => format!(
            "{refusal} ({:.3} mm and {:.3} mrad away)",
            norm(status.position_error_m) * 1e3,
            norm(status.orientation_error_rad) * 1e3
        ),
        _ => sentence(refusal),
    }
}

#[cfg(test)]
mod tests;
