//! Observations of the platform from the status of the daemon, received by a separate thread, so that publishing setpoints
//! does not wait for it.

use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{sleep, spawn};
use std::time::Duration;

use crate::commands::request::carry_out_in_background;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::operator::protocol::AnswerLine as Answer;
use hexad_client::operator::requests::{StopBaseline, request_status_as_source};
use hexad_client::operator::ride::{RideOrder, RidePhase};
use hexad_client::operator::{OperatorError, Order};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::state::Request;
use hexad_daemon::target_source::{Feed, Observation, TargetError};
use hexad_machine::config::Config;

/// Interval between two requests.
const INTERVAL: Duration = Duration::from_millis(50);

/// The two newest observations.
#[derive(Clone, Debug, Default)]
struct Watched {
    newest: Observation,
    before: Option<Observation>,
    /// Error of the last request.
    error: Option<String>,
    /// What the next request says of the datagrams.
    input: Option<String>,
    /// What the source does.
    phase: Option<RidePhase>,
    /// The phase that the last request said, and the order in its answer.
    order: Option<(RidePhase, RideOrder)>,
}

/// Receiver of the daemon's status. Its thread ends after it is dropped.
pub struct StatusFeed {
    shared: Arc<Mutex<Watched>>,
    watched: Watched,
    machine: String,
    baseline: StopBaseline,
    /// Longest wait for control; `None` once it was requested and decided.
    within: Option<Duration>,
    engagement: Option<Receiver<Result<(), OperatorError>>>,
    stop: Stop,
}

impl StatusFeed {
    /// Starts the thread with a first status.
    pub fn start(config: &Config, first: &Answer, within: Option<Duration>, stop: &Stop) -> Self {
        let home = config.machine.home;
        let newest = Observation::of_answer(first, monotonic_ns(), &home).unwrap_or_default();
        let watched = Watched { newest, ..Watched::default() };
        let shared = Arc::new(Mutex::new(watched.clone()));
        let (weak, machine) = (Arc::downgrade(&shared), config.name.clone());
        let name = machine.clone();
        spawn(move || {
            while let Some(shared) = weak.upgrade() {
                let requested_ns = monotonic_ns();
                let (input, phase) = {
                    let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
                    (shared.input.take(), shared.phase)
                };
                let answer = request_status_as_source(&name, input, phase);
                let order = phase.zip(answer.as_ref().ok().and_then(order_for_this_process));
                shared.lock().unwrap_or_else(PoisonError::into_inner).receive(
                    requested_ns,
                    answer,
                    order,
                    &home,
                );
                // Nothing is held while it sleeps: neither the lock, for which the setpoints would wait, nor what ends this thread.
                drop(shared);
                sleep(INTERVAL);
            }
        });
        let baseline = StopBaseline::before(first);
        Self { shared, watched, machine, baseline, within, engagement: None, stop: stop.clone() }
    }

    /// Describes the input of this source, if the last description was sent, and what the source does. Returns what the operator, who
    /// has seen it do so, wants of it.
    pub fn describe(&self, phase: RidePhase, describe: impl FnOnce() -> String) -> Option<RideOrder> {
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        shared.input.get_or_insert_with(describe);
        shared.phase = Some(phase);
        shared.order.filter(|(seen, _)| *seen == phase).map(|(_, order)| order)
    }
}

impl Feed for StatusFeed {
    fn observe(&mut self) -> Result<(&Observation, Option<&Observation>), TargetError> {
        self.watched.clone_from(&self.shared.lock().unwrap_or_else(PoisonError::into_inner));
        match &self.watched.error {
            Some(error) => Err(TargetError::NoAnswer(error.clone())),
            None => Ok((&self.watched.newest, self.watched.before.as_ref())),
        }
    }

    fn request_control(&mut self) -> Result<(), TargetError> {
        let Some(timeout) = self.within else { return Ok(()) };
        let engagement = self.engagement.get_or_insert_with(|| {
            let baseline = Some(self.baseline);
            let order = Order { is_patient: true, baseline, ..Order::new(Request::Engage, timeout) };
            carry_out_in_background(&self.machine, order, &self.stop)
        });
        let Ok(outcome) = engagement.try_recv() else { return Ok(()) };
        self.within = None;
        match outcome {
            // The command has received the same signal.
            Err(OperatorError::Interrupted) => Ok(()),
            outcome => Ok(outcome?),
        }
    }
}

/// The order of an operator for this process.
fn order_for_this_process(answer: &Answer) -> Option<RideOrder> {
    let mut processes = answer.status.iter().flat_map(|report| &report.sources).flat_map(|it| &it.processes);
    processes.find(|process| process.process_id == std::process::id())?.ride_order
}

impl Watched {
    fn receive(
        &mut self,
        requested_ns: u64,
        answer: Result<Answer, OperatorError>,
        order: Option<(RidePhase, RideOrder)>,
        home: &[f64; 6],
    ) {
        self.order = order;
        let seen = answer.map(|answer| Observation::of_answer(&answer, requested_ns, home));
        match seen {
            Ok(seen) => {
                let before = core::mem::replace(&mut self.newest, seen.unwrap_or_default());
                (self.before, self.error) = (Some(before), None);
            }
            Err(error) => self.error = Some(error.to_string()),
        }
    }
}
