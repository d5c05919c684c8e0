//! The requests `ride_start` and `ride_end`, which the source of setpoints reads in its answers to `status`.

use super::Server;
use super::answer::{OpenRequest, answer_line};
use super::connection::Connection;
use crate::process_names::sentence;
use crate::snapshot::Snapshot;
use hexad_client::operator::protocol::{AnswerLine, RequestLine, RequestResult, STOPPED};
use hexad_client::operator::ride::{RideOrder, RideVerdict};
use hexad_client::operator::status_report::StopNumber;
use hexad_core::control::signals::diagnostic::Diagnostic;
use hexad_core::control::signals::state::State;

/// Longest time for which an order for a ride is valid \[s\]. Nobody remembers an older one.
const MAX_VALID_S: f64 = 60.0;

/// An order that waits for its source.
#[derive(Debug)]
pub struct PendingRide {
    order: RideOrder,
    is_confirmed: bool,
    source: u32,
    stops: StopNumber,
    deadline_ns: u64,
}

/// What a pending order has come to.
type Outcome = Option<(RequestResult, String)>;

impl Server<'_> {
    /// Passes an order to the source, or refuses it. False if the client has left.
    pub(super) fn begin_ride(
        &mut self,
        connection: &mut Connection,
        request: OpenRequest,
        line: &RequestLine,
        order: RideOrder,
        snapshot: &Snapshot,
    ) -> bool {
        connection.peer.log_request(line);
        let refusal = self.refusal(line, snapshot);
        let source = match self.source_for(connection, line, order, snapshot) {
            Ok(source) if refusal.is_none() => source,
            source => {
                let reason = source.err().unwrap_or_default();
                let refusal =
                    refusal.unwrap_or_else(|| answer(RequestResult::Refused, order, snapshot, reason));
                connection.peer.log_failure(&refusal);
                return connection.answer(request, refusal);
            }
        };
        let accepted = request.progress(answer(RequestResult::Accepted, order, snapshot, "accepted".into()));
        let within_ns = (line.within_s.clamp(0.0, MAX_VALID_S) * 1e9) as u64;
        let (stops, deadline_ns) = (self.stops(), self.woke_ns + within_ns);
        let ride = PendingRide { order, is_confirmed: line.yes, source, stops, deadline_ns };
        connection.ride = Some((request, ride));
        accepted.is_none_or(|line| connection.send(&line))
    }

    /// The source that an order is for, or why there is none.
    fn source_for(
        &self,
        connection: &Connection,
        line: &RequestLine,
        order: RideOrder,
        snapshot: &Snapshot,
    ) -> Result<u32, String> {
        if line.remote.is_some() {
            return Err("a ride begins and ends on this host, where it is seen".into());
        }
        if connection.ride.is_some() {
            return Err("an order of this connection is in progress".into());
        }
        let Some((source, phase)) = self.status.rider(self.woke_ns) else {
            let control = control_text(snapshot).map_or_else(String::new, |text| format!("; {text}"));
            return Err(format!("no hexad move --udp moves this machine{control}"));
        };
        match order.verdict(phase, line.yes) {
            RideVerdict::Reached(reason) | RideVerdict::Refused(reason) => Err(reason.into()),
            RideVerdict::Pending => control_text(snapshot).map_or(Ok(source), Err),
        }
    }

    /// Answers the orders that have ended, and shows the others to their sources. One ends with the connection of who gave it.
    pub(super) fn advance_rides(&mut self) {
        let snapshot = *self.snapshots.read();
        let mut connections = core::mem::take(&mut self.connections);
        let mut orders = vec![];
        connections.retain_mut(|connection| {
            let Some((request, ride)) = connection.ride.take() else { return true };
            if let Some((result, text)) = self.outcome(&ride, &snapshot) {
                let answer = answer(result, ride.order, &snapshot, text);
                connection.peer.log_failure(&answer);
                return connection.answer(request, answer);
            }
            orders.push((ride.source, ride.order));
            connection.ride = Some((request, ride));
            true
        });
        self.status.set_ride_orders(&orders);
        self.connections = connections;
    }

    fn outcome(&self, ride: &PendingRide, snapshot: &Snapshot) -> Outcome {
        if ride.stops != self.stops() {
            return Some((RequestResult::Superseded, STOPPED.into()));
        }
        if let Some(text) = control_text(snapshot) {
            return Some((RequestResult::Failed, text));
        }
        let phase = self.status.rider(self.woke_ns).filter(|(source, _)| *source == ride.source);
        let Some((_, phase)) = phase else {
            return Some((RequestResult::Failed, "the source of setpoints has ended".into()));
        };
        match ride.order.verdict(phase, ride.is_confirmed) {
            RideVerdict::Reached(_) => Some((RequestResult::Done, "done".into())),
            RideVerdict::Refused(reason) => Some((RequestResult::Refused, reason.into())),
            RideVerdict::Pending if self.woke_ns > ride.deadline_ns => {
                let input = self.status.input(ride.source);
                Some((
                    RequestResult::TimedOut,
                    format!("no stream has come in time ({input}); give the order again"),
                ))
            }
            RideVerdict::Pending => None,
        }
    }
}

/// Why nobody rides; `None` under control.
fn control_text(snapshot: &Snapshot) -> Option<String> {
    let diagnostic = snapshot.status.diagnostic.diagnostic().unwrap_or_default();
    let state = snapshot.status.state().unwrap_or_default();
    let text =
        || format!("the platform is not under control (state {}: {})", state.name(), sentence(&diagnostic));
    (state != State::Active).then(text)
}

fn answer(result: RequestResult, order: RideOrder, snapshot: &Snapshot, text: String) -> AnswerLine {
    let state = snapshot.status.state().unwrap_or_default();
    answer_line(result, order.name(), state, &Diagnostic::default(), text)
}
