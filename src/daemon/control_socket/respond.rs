//! Requests of clients, one per line: each is answered at once, or begun and answered later.

use core::sync::atomic::Ordering;

use tracing::debug;

use super::answer::OpenRequest;
use super::connection::Connection;
use super::order::{Order, PendingOrder, overruling_count};
use super::pending_file::{PendingFile, RECORD};
use super::reload::RELOAD;
use super::ride::PendingRide;
use super::{MAX_WITHIN_S, Server};
use crate::leg_confirmation::{IN_ORDER, geometry_sha1};
use crate::motion_requests::order::MotionOrder;
use crate::process_names::{is_stopped, named, sentence};
use crate::snapshot::Snapshot;
use hexad_client::operator::motion_fields::{GOTO, HOLD, JOG};
use hexad_client::operator::protocol::{AnswerLine, CONFIRM_LEGS, RequestLine, RequestResult, STOPPED};
use hexad_client::operator::ride::RideOrder;
use hexad_client::operator::status_report::StopNumber;
use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad_core::control::signals::state::Request;
use hexad_core::model::LEGS;

/// Answers to requests about files and legs.
const FILE_IN_PROGRESS: &str = "a file for this connection is in progress";
const OTHER_GEOMETRY: &str = "the daemon runs with another name or other joints than this machine file; hexad reload, or give the daemon's file";
const NO_CYCLE: &str = "cycle_ns names a cycle in simulated time: only requests to the controller have it, and only of a daemon with \
    realtime.release = \"lockstep\"; send the request without it";
const NOT_KEPT: &str =
    "not kept, as this daemon has no state folder (hexad run --state FOLDER) or runs in simulated time";

impl Server<'_> {
    /// Responds to a line. False if the connection must be closed. `status` caches the answer to `status` for
    /// this round.
    pub(super) fn respond(
        &mut self,
        connection: &mut Connection,
        line: &RequestLine,
        snapshot: &Snapshot,
        status: &mut Option<AnswerLine>,
    ) -> bool {
        let request = OpenRequest::of(line);
        if line.request == "status" {
            self.status.mover = self.motions.client(&self.connection_ids);
            self.status.stops = Some(self.stops());
            self.status.describe_source(connection.peer.process_id.cast_unsigned(), line, self.woke_ns);
            let answer = status.get_or_insert_with(|| self.status.answer(snapshot, self.woke_ns));
            debug!(user = %connection.peer.user(), process = connection.peer.process_id, "status");
            return connection.answer(request, answer.clone());
        }
        let (of_controller, is_simulated) = (line.controller_request(), self.is_simulated());
        if line.cycle_ns.is_some() && !line.is_stop() && !(is_simulated && of_controller.is_some()) {
            return connection.answer(request, AnswerLine::invalid(NO_CYCLE.into()));
        }
        let Some(of_controller) = of_controller else {
            return match line.request.as_str() {
                RELOAD => self.begin_reload(connection, request, line, snapshot),
                RECORD => self.begin_recording(connection, request, line),
                CONFIRM_LEGS => self.confirm_legs(connection, request, line, snapshot),
                name if MotionOrder::is_named(name) => self.begin_motion(connection, request, line, snapshot),
                other => {
                    if let Some(order) = RideOrder::by_name(other) {
                        return self.begin_ride(connection, request, line, order, snapshot);
                    }
                    let names = Request::ALL.map(Request::name).join(", ");
                    let rides = RideOrder::ALL.map(RideOrder::name).join(", ");
                    let text = format!(
                        "unknown request {other:?}; must be one of status, {RECORD}, {RELOAD}, {GOTO}, {HOLD}, {JOG}, {CONFIRM_LEGS}, {rides}, {names}"
                    );
                    connection.answer(request, AnswerLine::invalid(text))
                }
            };
        };
        let is_read = self.begin(connection, request, of_controller, line, snapshot);
        connection.peer.log_request(line);
        is_read
    }

    /// Posts a request to the controller, or refuses it. First the requests of the connection that it replaces are answered.
    fn begin(
        &mut self,
        connection: &mut Connection,
        request: OpenRequest,
        of_controller: Request,
        line: &RequestLine,
        snapshot: &Snapshot,
    ) -> bool {
        let stops_before = overruling_count(self.links.word, of_controller);
        let refusal = if of_controller.can_begin_control() { self.refusal(line, snapshot) } else { None };
        let refusal = refusal.or_else(|| self.refused_pose(line, snapshot));
        let within_ns = (line.within_s.clamp(0.0, MAX_WITHIN_S) * 1e9) as u64;
        let order = Order {
            request: of_controller,
            stops_before,
            waits: line.wait,
            // Until a cycle has read the selected pose.
            is_patient: line.until_ready || line.pose.is_some_and(|number| number > 1),
            deadline_ns: self.woke_ns + within_ns,
            cycle_ns: line.cycle_ns.filter(|_| self.is_simulated()),
        };
        // What is answered takes no control any more.
        let replaced = connection.pending.take().inspect(|(_, replaced)| replaced.cancel(self.links.word));
        let post = || PendingOrder::post(order, snapshot, self.links.word, (self.clock)());
        let pending = refusal.is_none().then(post);
        let is_read = replaced.is_none_or(|(it, order)| connection.answer(it, order.superseded(snapshot)));
        let is_read = self.supersede_motion(connection, snapshot) && is_read;
        if let Some(answer) = refusal {
            connection.peer.log_failure(&answer);
            return connection.answer(request, answer) && is_read;
        }
        connection.pending = pending.map(|pending| (request, pending));
        is_read
    }

    /// Selects the pose of a request, or returns the refusal. A bridge may not select one: only an operator at the platform sees it.
    fn refused_pose(&self, line: &RequestLine, snapshot: &Snapshot) -> Option<AnswerLine> {
        let number = line.pose?;
        let is_here = line.remote.is_none() && line.request == Request::Engage.name();
        let chosen = match is_here {
            true => self.links.gate.choose(number as usize, snapshot.measurement.as_ref()),
            false => Err("only engage selects a pose, and only from this host".into()),
        };
        let code = DiagnosticCode::OtherPoses;
        chosen.err().map(|text| snapshot.answer(RequestResult::Refused, &line.request, code, text))
    }

    /// Passes a recording to the recorder. False if the client has left.
    fn begin_recording(&self, connection: &mut Connection, request: OpenRequest, line: &RequestLine) -> bool {
        connection.peer.log_request(line);
        if connection.pending_file.is_some() {
            return connection.answer(request, AnswerLine::invalid(FILE_IN_PROGRESS.into()));
        }
        match PendingFile::last_seconds(&self.links.windows, connection.file.take(), line.last_s) {
            Ok(ordered) => connection.pending_file.replace((request, ordered)).is_none(),
            Err(reason) => connection.answer(request, AnswerLine::invalid(reason)),
        }
    }

    /// Passes an order for a ride to the source, or refuses it. False if the client has left.
    fn begin_ride(
        &mut self,
        connection: &mut Connection,
        request: OpenRequest,
        line: &RequestLine,
        order: RideOrder,
        snapshot: &Snapshot,
    ) -> bool {
        connection.peer.log_request(line);
        let answer = |result, text: &str| snapshot.answer(result, order.name(), DiagnosticCode::None, text);
        let refused = |reason: &str| answer(RequestResult::Refused, reason);
        let (rider, stops) = (self.status.rider(self.woke_ns), self.stops());
        let ride = PendingRide::new(order, line, rider, stops, snapshot, self.woke_ns);
        let refusal = self.refusal(line, snapshot).or_else(|| {
            let other = || refused("an order of this connection is in progress");
            connection.ride.as_ref().map(|_| other())
        });
        match (refusal, ride) {
            (None, Ok(ride)) => {
                let accepted = request.progress(answer(RequestResult::Accepted, "accepted"));
                connection.ride = Some((request, ride));
                accepted.is_none_or(|line| connection.send(&line))
            }
            (refusal, ride) => {
                let answer = refusal.unwrap_or_else(|| refused(&ride.err().unwrap_or_default()));
                connection.peer.log_failure(&answer);
                connection.answer(request, answer)
            }
        }
    }

    /// Answers the orders for rides that have ended, and shows the others to their sources. An order ends when its client leaves, also
    /// one that left before the order was read.
    pub(super) fn advance_rides(&mut self) {
        let (snapshot, now_ns, stops) = (*self.links.snapshots.read(), self.woke_ns, self.stops());
        let rider = self.status.rider(now_ns);
        let status = &mut self.status;
        let mut orders = vec![];
        self.connections.retain_mut(|connection| {
            let Some((request, ride)) = connection.ride.take() else { return true };
            if connection.has_left() {
                request.forget();
                return true;
            }
            let input = status.input(ride.source);
            if let Some(answer) = ride.answer(rider, stops, input, &snapshot, now_ns) {
                connection.peer.log_failure(&answer);
                return connection.answer(request, answer);
            }
            orders.push((ride.source, ride.order));
            connection.ride = Some((request, ride));
            true
        });
        status.set_ride_orders(&orders);
    }

    /// Keeps which legs a person has seen; without legs, only compares the geometry. False if the client has left.
    fn confirm_legs(
        &self,
        connection: &mut Connection,
        request: OpenRequest,
        line: &RequestLine,
        snapshot: &Snapshot,
    ) -> bool {
        connection.peer.log_request(line);
        let config = &self.status.loaded().config;
        let named = |result, text: &str| snapshot.answer(result, CONFIRM_LEGS, DiagnosticCode::None, text);
        let answer = match (line.legs, &self.status.legs) {
            _ if line.remote.is_some() => {
                named(RequestResult::Refused, "legs are confirmed on this host, where they are seen")
            }
            _ if line.geometry_sha1.as_ref() != Some(&geometry_sha1(config)) => {
                named(RequestResult::Refused, OTHER_GEOMETRY)
            }
            (None, _) => named(RequestResult::Done, ""),
            (Some(legs), _) if legs.iter().any(|leg| !IN_ORDER.contains(leg)) => {
                AnswerLine::invalid(format!("legs {legs:?}: each must be 1 to {LEGS}"))
            }
            (Some(_), None) => named(RequestResult::Done, NOT_KEPT),
            _ if connection.pending_file.is_some() => AnswerLine::invalid(FILE_IN_PROGRESS.into()),
            (Some(legs), Some(confirmation)) => {
                let written = confirmation.store(config, legs);
                connection.pending_file = Some((request, PendingFile { request: CONFIRM_LEGS, written }));
                return true;
            }
        };
        connection.answer(request, answer)
    }

    fn is_simulated(&self) -> bool {
        self.status.loaded().config.deployment.realtime.is_simulated()
    }

    /// The number of stops so far.
    pub(super) fn stops(&self) -> StopNumber {
        StopNumber { daemon: self.began_us, count: overruling_count(self.links.word, Request::Engage) }
    }

    /// Answer to a request that would begin control or motion, if the daemon ends, if the request may be old, or if a stop came after
    /// it was asked for.
    pub(super) fn refusal(&mut self, line: &RequestLine, snapshot: &Snapshot) -> Option<AnswerLine> {
        let answer = |result, code: DiagnosticCode, text: &str| {
            Some(snapshot.answer(result, &line.request, code, text))
        };
        if self.links.is_ending.load(Ordering::Relaxed) {
            let code = DiagnosticCode::DaemonEnding;
            return answer(RequestResult::Refused, code, code.name());
        }
        if line.stops.is_some_and(|stops_before| stops_before != self.stops()) {
            return answer(RequestResult::Superseded, DiagnosticCode::None, STOPPED);
        }
        // A silent one applies forces again when it goes on.
        if let [one, other, ..] = self.status.drivers()[..] {
            let is_second = snapshot.measured_publishers.used_pid == other;
            let [used, ignored] = if is_second { [other, one] } else { [one, other] };
            let two = Diagnostic::new(DiagnosticCode::TwoMeasuredSources, used.into(), ignored.into());
            let text = sentence(&two);
            return Some(snapshot.answer(RequestResult::Refused, &line.request, two, text));
        }
        let mut drivers = self.status.drivers().into_iter().filter(|_| !line.until_ready);
        if let Some(stopped) = drivers.find(|driver| is_stopped(*driver)) {
            let text = format!("no measurements come from {}", named(stopped));
            return answer(RequestResult::Refused, DiagnosticCode::MeasurementLost, &text);
        }
        let text = "the daemon was held and the request may be old; send it again";
        // One that names its cycle is not late for it.
        let is_stale = self.woke_ns < self.stale_until_ns && line.cycle_ns.is_none();
        is_stale.then(|| answer(RequestResult::Stale, DiagnosticCode::None, text)).flatten()
    }
}
