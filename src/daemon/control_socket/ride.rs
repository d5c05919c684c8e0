//! Orders for a ride, which the source of setpoints reads in its answers to `status`.

use crate::process_names::sentence;
use crate::snapshot::Snapshot;
use hexad_client::operator::protocol::{AnswerLine, RequestLine, RequestResult, STOPPED};
use hexad_client::operator::ride::{RideOrder, RidePhase, RideVerdict};
use hexad_client::operator::status_report::StopNumber;
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::state::State;

/// Longest time for which an order for a ride is valid \[s\]. Nobody remembers an older one.
const MAX_VALID_S: f64 = 60.0;

/// A source with a ride: its process, and its phase.
pub type Rider = (u32, RidePhase);

/// An order that waits for its source.
#[derive(Debug)]
pub struct PendingRide {
    pub order: RideOrder,
    pub source: u32,
    is_confirmed: bool,
    stops: StopNumber,
    deadline_ns: u64,
}

impl PendingRide {
    /// An order of this instant \[ns\], or why there is none.
    pub fn new(
        order: RideOrder,
        line: &RequestLine,
        rider: Option<Rider>,
        stops: StopNumber,
        snapshot: &Snapshot,
        now_ns: u64,
    ) -> Result<Self, String> {
        if line.remote.is_some() {
            return Err("a ride begins and ends on this host, where it is seen".into());
        }
        let Some((source, phase)) = rider else {
            let control = control_text(snapshot).map_or_else(String::new, |text| format!("; {text}"));
            return Err(format!("no hexad move --udp moves this machine{control}"));
        };
        match order.verdict(phase, line.yes) {
            RideVerdict::Reached(reason) | RideVerdict::Refused(reason) => Err(reason.into()),
            RideVerdict::Pending => {
                let deadline_ns = now_ns + (line.within_s.clamp(0.0, MAX_VALID_S) * 1e9) as u64;
                let new = Self { order, source, is_confirmed: line.yes, stops, deadline_ns };
                control_text(snapshot).map_or(Ok(new), Err)
            }
        }
    }

    /// The answer, once the order has ended. `input`: what the source says of its stream.
    pub fn answer(
        &self,
        rider: Option<Rider>,
        stops: StopNumber,
        input: &str,
        snapshot: &Snapshot,
        now_ns: u64,
    ) -> Option<AnswerLine> {
        let ended =
            |result, text: &str| Some(snapshot.answer(result, self.order.name(), DiagnosticCode::None, text));
        if self.stops != stops {
            return ended(RequestResult::Superseded, STOPPED);
        }
        if let Some(text) = control_text(snapshot) {
            return ended(RequestResult::Failed, &text);
        }
        let Some((_, phase)) = rider.filter(|(source, _)| *source == self.source) else {
            return ended(RequestResult::Failed, "the source of setpoints has ended");
        };
        match self.order.verdict(phase, self.is_confirmed) {
            RideVerdict::Reached(_) => ended(RequestResult::Done, "done"),
            RideVerdict::Refused(reason) => ended(RequestResult::Refused, reason),
            RideVerdict::Pending if now_ns > self.deadline_ns => {
                let text = format!("no stream has come in time ({input}); give the order again");
                ended(RequestResult::TimedOut, &text)
            }
            RideVerdict::Pending => None,
        }
    }
}

/// Why nobody rides; `None` under control.
fn control_text(snapshot: &Snapshot) -> Option<String> {
    let (state, diagnostic) = (snapshot.state(), snapshot.diagnostic());
    let text =
        || format!("the platform is not under control (state {}: {})", state.name(), sentence(&diagnostic));
    (state != State::Active).then(text)
}
