//! Answers to requests as lines of the protocol: each request has exactly one, unless its client has left.

use std::thread::panicking;

use hexad_client::operator::protocol::{AnswerLine, DiagnosticReport, RequestLine, RequestResult, VERSION};
use hexad_core::control::signals::diagnostic::Diagnostic;
use hexad_core::control::signals::state::State;

use crate::process_names::sentence;
use crate::snapshot::Snapshot;

/// A request without an answer yet. [`Self::answer`] or [`Self::forget`] must consume it.
#[derive(Debug)]
#[must_use = "each request has exactly one answer"]
pub(super) struct OpenRequest {
    id: Option<u64>,
    wants_progress: bool,
    is_settled: bool,
}

impl OpenRequest {
    /// The request of a line.
    pub fn of(line: &RequestLine) -> Self {
        let wants_progress = line.progress || line.cycle_ns.is_some();
        Self { id: line.id, wants_progress, is_settled: false }
    }

    /// The answer, for the client that has sent the request.
    pub fn answer(mut self, answer: AnswerLine) -> AnswerLine {
        self.is_settled = true;
        AnswerLine { id: self.id, ..answer }
    }

    /// A line before the answer, if the client wants it.
    pub fn progress(&self, line: AnswerLine) -> Option<AnswerLine> {
        self.wants_progress.then_some(AnswerLine { id: self.id, ..line })
    }

    /// The client has left.
    pub fn forget(mut self) {
        self.is_settled = true;
    }
}

impl Drop for OpenRequest {
    fn drop(&mut self) {
        debug_assert!(self.is_settled || panicking(), "a request without an answer");
    }
}

impl Snapshot {
    pub(super) fn state(&self) -> State {
        self.status.state().unwrap_or_default()
    }

    pub(super) fn diagnostic(&self) -> Diagnostic {
        self.status.diagnostic.diagnostic().unwrap_or_default()
    }

    /// Answer to a request in this state.
    pub(super) fn answer(
        &self,
        result: RequestResult,
        request: &str,
        diagnostic: impl Into<Diagnostic>,
        text: impl Into<String>,
    ) -> AnswerLine {
        let (request, state) = (request.into(), self.state().name().into());
        let (diagnostic, text) = (diagnostic_report(&diagnostic.into()), text.into());
        AnswerLine { version: VERSION, result, request, id: None, state, diagnostic, text, status: None }
    }
}

/// A diagnostic for answers and reports.
pub(super) fn diagnostic_report(diagnostic: &Diagnostic) -> DiagnosticReport {
    let finite = |number: f64| Some(number).filter(|number| number.is_finite());
    let Diagnostic { code, value, bound, index } = *diagnostic;
    DiagnosticReport {
        code: code as u32,
        name: code.name().into(),
        value: finite(value),
        bound: finite(bound),
        index,
        text: sentence(diagnostic),
    }
}
