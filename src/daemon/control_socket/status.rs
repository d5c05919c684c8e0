//! Answer to `status`: the newest cycle, in the units of the messages, for panels and `hexad status`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::process;
use std::sync::Arc;

use crate::leg_confirmation::LegConfirmation;
use crate::process_names::{command, is_stopped, sentence};
use crate::recorder::interruption::Interruption;
use crate::reload::Loaded;
use crate::snapshot::Snapshot;
use crate::version::VERSION as BUILD;
use hexad_client::messages::location::{SEGMENTS_DELETED, are_segments_deleted};
use hexad_client::messages::{Bus, MeasuredMessage, Rejection, SetpointMessage, TopicObserver};
use hexad_client::operator::protocol::{AnswerLine, RequestLine, RequestResult};
use hexad_client::operator::ride::{RideOrder, RidePhase};
use hexad_client::operator::status_report::{
    ConfigurationReport, LegReport, ProcessReport, SourceReport, StatusReport, StopNumber, TimingReport,
};
use hexad_client::operator::users::user_name;
use hexad_core::control::signals::inputs::{Publishers, SetpointKind};
use hexad_core::control::signals::limits::{Limit, LimitSet};
use hexad_core::control::signals::state::State;
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::model::LEGS;
use hexad_machine::config::Config;
use hexad_machine::text::excerpt::excerpt_of_length;

/// Longest description of the input of a source, in characters.
const MAX_INPUT: usize = 600;

/// Longest time without a word of a source with a ride \[ns\].
const MAX_SILENCE_NS: u64 = 1_000_000_000;

/// Sources whose descriptions are kept.
const MAX_INPUTS: usize = 16;

/// Source of status reports.
pub struct StatusSource {
    loaded: Arc<Loaded>,
    reloads: u64,
    interruption: Arc<Interruption>,
    /// Confirmation of the legs; `None` if it is not kept.
    pub legs: Option<Arc<LegConfirmation>>,
    /// Process of the client whose motion the daemon publishes.
    pub mover: Option<u32>,
    /// Stops so far.
    pub stops: Option<StopNumber>,
    /// Topics, opened at the first report; `None` if they cannot be opened: then the processes are unknown.
    topics: Option<Option<Topics>>,
    /// Processes that have published measurements.
    drivers: BTreeSet<u32>,
    /// What processes say of themselves.
    pub(super) inputs: BTreeMap<u32, SourceInput>,
}

/// What a source of setpoints says of itself, and what the operator wants of it.
#[derive(Clone, Debug, Default)]
pub(super) struct SourceInput {
    text: Option<String>,
    ride: Option<RidePhase>,
    pub(super) order: Option<RideOrder>,
    /// Instant at which it said so \[ns\].
    said_ns: u64,
}

struct Topics {
    _bus: Bus,
    setpoint: TopicObserver<SetpointMessage>,
    measured: TopicObserver<MeasuredMessage>,
}

impl Topics {
    fn open(config: &Config) -> Option<Self> {
        // This thread serves stops.
        let bus = Bus::join_at_once(&config.name, config.deployment.realtime.is_simulated()).ok()?;
        Some(Self { setpoint: bus.topic().ok()?, measured: bus.topic().ok()?, _bus: bus })
    }
}

impl StatusSource {
    /// Source for a machine.
    pub fn new(
        loaded: Arc<Loaded>,
        interruption: Arc<Interruption>,
        legs: Option<Arc<LegConfirmation>>,
    ) -> Self {
        let inputs = BTreeMap::new();
        Self {
            loaded,
            reloads: 0,
            interruption,
            legs,
            mover: None,
            stops: None,
            topics: None,
            drivers: BTreeSet::new(),
            inputs,
        }
    }

    /// Keeps what a process says of itself with a request for the status, for as long as it publishes setpoints.
    pub fn describe_source(&mut self, process_id: u32, line: &RequestLine, now_ns: u64) {
        let says = line.input.is_some() || line.ride.is_some();
        if says && (self.inputs.len() < MAX_INPUTS || self.inputs.contains_key(&process_id)) {
            let source = self.inputs.entry(process_id).or_default();
            (source.ride, source.said_ns) = (line.ride, now_ns);
            source.text =
                line.input.as_ref().map(|text| excerpt_of_length(text, MAX_INPUT)).or(source.text.take());
        }
    }

    /// The source with a ride that has lately said its phase.
    pub fn rider(&self, now_ns: u64) -> Option<(u32, RidePhase)> {
        let is_new = |source: &SourceInput| now_ns.saturating_sub(source.said_ns) < MAX_SILENCE_NS;
        let riders = self.inputs.iter().filter(|(_, source)| is_new(source));
        riders.filter_map(|(process_id, source)| Some((*process_id, source.ride?))).next()
    }

    /// Notes the processes whose measurements arrive.
    pub fn note_drivers(&mut self, Publishers { used_pid, ignored_pid_or_0 }: Publishers) {
        self.drivers.extend([used_pid, ignored_pid_or_0].into_iter().filter(|process_id| *process_id != 0));
    }

    /// The processes that have published measurements, may do so again, and live, silent or not.
    pub fn drivers(&mut self) -> Vec<u32> {
        let topics = self.topics.get_or_insert_with(|| Topics::open(&self.loaded.config));
        let Some(topics) = topics else { return vec![] };
        let listed = topics.measured.publisher_process_ids();
        self.drivers.retain(|process_id| listed.contains(process_id) && !command(*process_id).is_empty());
        self.drivers.iter().copied().collect()
    }

    /// What a source says of its input.
    pub fn input(&self, process_id: u32) -> &str {
        self.inputs.get(&process_id).and_then(|source| source.text.as_deref()).unwrap_or_default()
    }

    /// The orders of operators for sources.
    pub fn set_ride_orders(&mut self, orders: &[(u32, RideOrder)]) {
        for (process_id, source) in &mut self.inputs {
            source.order = orders.iter().find(|(id, _)| id == process_id).map(|(_, order)| *order);
        }
    }

    /// Why the legs are not confirmed.
    pub fn leg_warning(&self) -> Option<String> {
        self.legs.as_ref()?.warning(&self.loaded.config)
    }

    /// The configuration in force.
    pub fn loaded(&self) -> &Arc<Loaded> {
        &self.loaded
    }

    /// Replaces the configuration after a reload.
    pub fn set_loaded(&mut self, loaded: Arc<Loaded>) {
        (self.loaded, self.reloads) = (loaded, self.reloads + 1);
    }

    /// Answer to a request for the status.
    pub fn answer(&mut self, snapshot: &Snapshot, now_ns: u64) -> AnswerLine {
        let diagnostic = snapshot.diagnostic();
        let answer = snapshot.answer(RequestResult::Done, "status", diagnostic, sentence(&diagnostic));
        AnswerLine { status: Some(Box::new(self.report(snapshot, now_ns))), ..answer }
    }

    fn report(&mut self, snapshot: &Snapshot, now_ns: u64) -> StatusReport {
        let loaded = self.loaded.clone();
        let Config { name, machine, deployment, place, .. } = &loaded.config;
        let status = &snapshot.status;
        let deleted = are_segments_deleted().then(|| SEGMENTS_DELETED.into());
        let (is_known, has_error) = (status.pose_valid == 1, status.error_valid == 1);
        let setpoint = snapshot.setpoint.filter(|setpoint| setpoint.task.is_finite());
        let follows = status.state().is_some_and(State::follows);
        let limits = Limit::ALL.into_iter().filter(|it| LimitSet(status.active_limits).contains(*it));
        StatusReport {
            version: BUILD.into(),
            machine: name.clone(),
            process_id: process::id(),
            stops: self.stops,
            warnings: [deleted, self.interruption.warning(now_ns), self.leg_warning()]
                .into_iter()
                .flatten()
                .collect(),
            configuration: ConfigurationReport {
                file: place.clone(),
                sha1: loaded.sha1.clone(),
                loaded_unix_s: loaded.loaded_unix_s,
                reloads: self.reloads,
            },
            age_s: (snapshot.time_ns > 0).then(|| seconds_since_or_0(snapshot.time_ns, now_ns)),
            limits_scale: deployment.limits.scale,
            active_limits: limits.map(|limit| limit.name().into()).collect(),
            timing: timing(snapshot, deployment.realtime.rate_hz),
            pose: is_known.then_some(status.x),
            setpoint: setpoint.map(|setpoint| setpoint.task.x.into()),
            target: setpoint
                .filter(|setpoint| setpoint.kind == SetpointKind::Target && follows)
                .map(|setpoint| setpoint.task.x.into()),
            in_position: status.in_position == 1,
            setpoint_distance: status
                .setpoint_error()
                .map(|error| [error.linear.norm(), error.angular.norm()])
                .filter(|distance| distance.iter().all(|number| number.is_finite())),
            position_error_m: has_error.then_some(status.position_error_m),
            orientation_error_rad: has_error.then_some(status.orientation_error_rad),
            condition: is_known.then_some(status.condition),
            condition_limit: deployment.limits.condition,
            time_to_singularity_s: Some(status.time_to_singularity_s)
                .filter(|time_s| is_known && time_s.is_finite()),
            legs: legs(snapshot, now_ns, deployment.timeouts.measured_s),
            stroke_m: [machine.actuator.min_length_m, machine.actuator.max_length_m],
            resolution: loaded.config.resolution(),
            max_force_n: machine.actuator.max_force_n,
            sources: self.sources(snapshot, now_ns),
        }
    }

    fn sources(&mut self, snapshot: &Snapshot, now_ns: u64) -> Vec<SourceReport> {
        let config = &self.loaded.config;
        // In simulated time the newest measurement is the present.
        let measured_ns = snapshot.measurement.map(|measurement| measurement.time_ns);
        let is_simulated = config.deployment.realtime.is_simulated();
        let now_ns = measured_ns.filter(|_| is_simulated).unwrap_or(now_ns);
        let topics = self.topics.get_or_insert_with(|| Topics::open(config)).as_ref();
        let setpoint_processes = topics.map(|topics| topics.setpoint.publisher_process_ids());
        self.inputs
            .retain(|id, _| setpoint_processes.as_ref().is_none_or(|processes| processes.contains(id)));
        let (mover, inputs) = (self.mover, &self.inputs);
        let source = |topic: &str,
                      time_ns: Option<u64>,
                      of: Publishers,
                      processes: Option<Vec<u32>>,
                      rejection: Option<Rejection>| SourceReport {
            topic: topic.into(),
            age_s: time_ns.map(|time_ns| seconds_since_or_0(time_ns, now_ns)),
            processes: processes
                .into_iter()
                .flatten()
                .map(|id| process_report(id, of, mover, inputs))
                .collect(),
            rejected: rejection.map(|rejection| rejection.to_string()),
        };
        vec![
            source(
                "setpoint",
                snapshot.setpoint.map(|setpoint| setpoint.time_ns),
                snapshot.setpoint_publishers,
                setpoint_processes,
                snapshot.setpoint_rejection,
            ),
            source(
                "measured",
                measured_ns,
                snapshot.measured_publishers,
                topics.map(|topics| topics.measured.publisher_process_ids()),
                snapshot.measured_rejection,
            ),
        ]
    }
}

fn timing(snapshot: &Snapshot, rate_hz: f64) -> TimingReport {
    let (counters, window) = (&snapshot.status.counters, &snapshot.window);
    TimingReport {
        rate_hz,
        cycles: counters.cycles,
        late_wakeups: counters.late_wakeups,
        overruns: counters.overruns,
        skipped: counters.skipped,
        wakeup_ns: [window.wakeup_ns.p99, window.wakeup_ns.max],
        compute_ns: [window.compute_ns.p99, window.compute_ns.max],
    }
}

/// The legs. Rates that are older than the timeout are of the past, as of a driver that has ended in motion.
fn legs(snapshot: &Snapshot, now_ns: u64, timeout_s: f64) -> Vec<LegReport> {
    let Some(measurement) = &snapshot.measurement else { return vec![] };
    let is_new =
        snapshot.status.pose_valid == 1 || seconds_since_or_0(measurement.time_ns, now_ns) < timeout_s;
    let rates = measurement.rate_m_s.filter(|_| is_new).map_or([None; LEGS], |rate| rate.map(Some));
    let numbers = measurement.length_m.iter().zip(rates).zip(&snapshot.command_n).take(LEGS);
    numbers
        .map(|((length, rate_m_s), force)| LegReport { length_m: *length, rate_m_s, force_n: *force })
        .collect()
}

/// A publisher. For a motion that the daemon publishes itself it is the client that has requested it.
fn process_report(
    publisher: u32,
    publishers: Publishers,
    mover: Option<u32>,
    inputs: &BTreeMap<u32, SourceInput>,
) -> ProcessReport {
    let process_id = mover.filter(|_| publisher == process::id()).unwrap_or(publisher);
    let user = fs::metadata(format!("/proc/{process_id}")).map(|found| user_name(found.uid()));
    let SourceInput { text: input, ride, order: ride_order, .. } =
        inputs.get(&publisher).cloned().unwrap_or_default();
    ProcessReport {
        process_id,
        command: command(process_id),
        user: user.unwrap_or_default(),
        is_ignored: publisher == publishers.ignored_pid_or_0,
        is_stopped: is_stopped(process_id),
        input,
        ride,
        ride_order,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_core::control::signals::inputs::{Measurement, Setpoint};
    use hexad_core::model::task::TaskState;
    use hexad_machine::config::Config;

    #[test]
    fn what_is_no_number_survives_json() {
        let config = Config::parse(include_str!("../../../config/fried2008.toml"), "a test").unwrap();
        let mut snapshot = Snapshot {
            setpoint: Some(Setpoint::motion(1, TaskState::at_rest([f64::NAN; 6]))),
            measurement: Some(Measurement { length_m: [f64::NAN; 6], ..Measurement::default() }),
            ..Snapshot::default()
        };
        snapshot.status.pose_valid = 1;
        (snapshot.status.condition, snapshot.status.time_to_singularity_s) = (f64::INFINITY, f64::INFINITY);
        (snapshot.status.setpoint_error_valid, snapshot.status.setpoint_position_error_m) = (1, [1e200; 3]);
        // Without topics, the processes are unknown.
        let source = StatusSource::new(Arc::new(Loaded::new(config)), Arc::default(), None);
        let mut source = StatusSource { topics: Some(None), ..source };
        let line = source.answer(&snapshot, 2).to_line();
        let answer: AnswerLine = serde_json::from_str(&line).unwrap();
        let report = answer.status.unwrap();
        assert!(report.legs.len() == 6 && report.legs.iter().all(|leg| leg.length_m.is_nan()));
        assert_eq!((report.setpoint, report.condition, report.time_to_singularity_s), (None, None, None));
        assert_eq!(report.setpoint_distance, None);
    }
}
