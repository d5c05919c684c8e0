//! Answer to `status`: the newest cycle in the units of the messages, for panels and `hexad status`.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::process;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize};

use super::connection::user_name;
use super::protocol::{AnswerLine, DiagnosticReport, RequestResult, VERSION};
use crate::config::Config;
use crate::control::controller::Publishers;
use crate::control::limits::{Limit, LimitSet};
use crate::daemon::process_names::{command, sentence};
use crate::daemon::reload::Loaded;
use crate::daemon::snapshot::Snapshot;
use crate::messages::{Bus, MeasuredMessage, Rejection, SetpointMessage, TopicObserver};
use crate::model::machine::LEGS;
use crate::output::version::VERSION as BUILD;

/// State of the daemon and of everything it knows, in SI units and radians.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StatusReport {
    /// Version, commit and build profile of the daemon.
    #[serde(default)]
    pub version: String,
    /// Name of the machine.
    pub machine: String,
    /// Process of the daemon.
    pub process_id: u32,
    /// The configuration in force.
    #[serde(default)]
    pub configuration: ConfigurationReport,
    /// Time since the cycle that this describes \[s\]; `None` before the first.
    pub age_s: Option<f64>,
    /// Names of the limits that the cycle has reached, or nearly.
    pub active_limits: Vec<String>,
    /// Rate and missed deadlines.
    pub timing: TimingReport,
    /// Measured X; `None` if the pose is unknown.
    pub pose: Option<[f64; 6]>,
    /// X of the newest setpoint; `None` if none ever arrived, or if it is not finite.
    pub setpoint: Option<[f64; 6]>,
    /// Reference minus measured under control, else setpoint minus measured \[m\].
    pub position_error_m: Option<[f64; 3]>,
    /// The same of the orientation \[rad\].
    pub orientation_error_rad: Option<[f64; 3]>,
    /// Condition of the pose; `None` if the pose is unknown.
    pub condition: Option<f64>,
    /// `limits.condition`.
    pub condition_limit: f64,
    /// Time until a singular pose if the motion continues \[s\]; `None` if none is ahead.
    pub time_to_singularity_s: Option<f64>,
    /// Measured legs; empty before the first measurement.
    pub legs: Vec<LegReport>,
    /// `actuator.min_length_m` and `actuator.max_length_m`.
    pub stroke_m: [f64; 2],
    /// `actuator.max_force_n`.
    pub max_force_n: f64,
    /// Senders of the inputs.
    pub sources: Vec<SourceReport>,
}

/// Machine file in force.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ConfigurationReport {
    /// The file as the daemon was started with it.
    pub file: String,
    /// SHA-1 of the file as it was read, as `sha1sum` prints it.
    pub sha1: String,
    /// Unix time at which it was read \[s\].
    pub loaded_unix_s: u64,
    /// Number of reloads that were carried out since start.
    pub reloads: u64,
}

/// Cycles and missed deadlines since start, and times of the last second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TimingReport {
    /// Configured rate \[Hz\].
    pub rate_hz: f64,
    /// Cycles run.
    pub cycles: u64,
    /// Cycles that woke late.
    pub late_wakeups: u64,
    /// Cycles still computing at their next release.
    pub overruns: u64,
    /// Releases for which no cycle was run.
    pub skipped: u64,
    /// Release to the first instruction, 99th percentile and largest \[ns\].
    pub wakeup_ns: [u64; 2],
    /// First instruction to output, 99th percentile and largest \[ns\].
    pub compute_ns: [u64; 2],
}

/// One leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LegReport {
    /// Measured length \[m\]; null in JSON if the driver sent no number.
    #[serde(deserialize_with = "number_or_nan")]
    pub length_m: f64,
    /// Measured rate \[m/s\]; null if the driver sends none.
    pub rate_m_s: Option<f64>,
    /// Commanded force \[N\]; 0 without control.
    pub force_n: f64,
}

/// JSON has no number that is none.
fn number_or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Option::deserialize(deserializer).map(|number| number.unwrap_or(f64::NAN))
}

/// Sender of an input.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceReport {
    /// `setpoint` or `measured`.
    pub topic: String,
    /// Age of the newest message \[s\]; `None` if none ever arrived.
    pub age_s: Option<f64>,
    /// Processes that publish now.
    pub processes: Vec<ProcessReport>,
    /// Why messages were rejected whatever they contain, with the remedy.
    #[serde(default)]
    pub rejected: Option<String>,
}

/// A process.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProcessReport {
    /// Number of the process.
    pub process_id: u32,
    /// Its command, empty if it has ended.
    pub command: String,
    /// Its user, empty if it has ended.
    pub user: String,
    /// Its messages arrive, and those of another process count.
    #[serde(default)]
    pub is_ignored: bool,
}

/// What status reports are made of.
pub struct StatusSource {
    loaded: Arc<Loaded>,
    reloads: u64,
    /// Opened at the first report; `None` if they cannot be opened, which leaves the processes unknown.
    topics: Option<Option<Topics>>,
}

struct Topics {
    _bus: Bus,
    setpoint: TopicObserver<SetpointMessage>,
    measured: TopicObserver<MeasuredMessage>,
}

impl Topics {
    fn open(config: &Config) -> Option<Self> {
        let is_simulated = config.deployment.realtime.is_simulated();
        let join = if is_simulated { Bus::join_simulated } else { Bus::join };
        let bus = join(&config.name).ok()?;
        Some(Self { setpoint: bus.topic().ok()?, measured: bus.topic().ok()?, _bus: bus })
    }
}

impl StatusSource {
    /// Reports of a machine.
    pub fn new(loaded: Arc<Loaded>) -> Self {
        Self { loaded, reloads: 0, topics: None }
    }

    /// Goes on with a configuration that was reloaded.
    pub fn set_loaded(&mut self, loaded: Arc<Loaded>) {
        (self.loaded, self.reloads) = (loaded, self.reloads + 1);
    }

    /// Answer to a request for the status.
    pub fn answer(&mut self, snapshot: &Snapshot, now_ns: u64) -> AnswerLine {
        let state = snapshot.status.state().unwrap_or_default();
        let diagnostic = snapshot.status.diagnostic.diagnostic().unwrap_or_default();
        let report = self.report(snapshot, now_ns);
        AnswerLine {
            version: VERSION,
            result: RequestResult::Done,
            request: "status".into(),
            state: state.name().into(),
            text: sentence(&diagnostic),
            diagnostic: DiagnosticReport::from(diagnostic),
            status: Some(Box::new(report)),
        }
    }

    fn report(&mut self, snapshot: &Snapshot, now_ns: u64) -> StatusReport {
        let loaded = self.loaded.clone();
        let Config { name, machine, deployment, place, .. } = &loaded.config;
        let status = &snapshot.status;
        let (is_known, has_error) = (status.pose_valid == 1, status.error_valid == 1);
        let limits = Limit::ALL.into_iter().filter(|it| LimitSet(status.active_limits).contains(*it));
        StatusReport {
            version: BUILD.into(),
            machine: name.clone(),
            process_id: process::id(),
            configuration: ConfigurationReport {
                file: place.clone(),
                sha1: loaded.sha1.clone(),
                loaded_unix_s: loaded.loaded_unix_s,
                reloads: self.reloads,
            },
            age_s: (snapshot.time_ns > 0).then(|| seconds(snapshot.time_ns, now_ns)),
            active_limits: limits.map(|limit| limit.name().into()).collect(),
            timing: timing(snapshot, deployment.realtime.rate_hz),
            pose: is_known.then_some(status.x),
            setpoint: snapshot
                .setpoint
                .filter(|setpoint| setpoint.task.is_finite())
                .map(|setpoint| setpoint.task.x.into()),
            position_error_m: has_error.then_some(status.position_error_m),
            orientation_error_rad: has_error.then_some(status.orientation_error_rad),
            condition: is_known.then_some(status.condition),
            condition_limit: deployment.limits.condition,
            time_to_singularity_s: Some(status.time_to_singularity_s)
                .filter(|time_s| is_known && time_s.is_finite()),
            legs: legs(snapshot),
            stroke_m: [machine.actuator.min_length, machine.actuator.max_length],
            max_force_n: machine.actuator.max_force,
            sources: self.sources(snapshot, now_ns),
        }
    }

    fn sources(&mut self, snapshot: &Snapshot, now_ns: u64) -> Vec<SourceReport> {
        let config = &self.loaded.config;
        // In simulated time the newest measurement is now.
        let measured_ns = snapshot.measurement.map(|measurement| measurement.time_ns);
        let is_simulated = config.deployment.realtime.is_simulated();
        let now_ns = measured_ns.filter(|_| is_simulated).unwrap_or(now_ns);
        let topics = self.topics.get_or_insert_with(|| Topics::open(config)).as_ref();
        let source = |topic: &str,
                      time_ns: Option<u64>,
                      of: Publishers,
                      processes: Option<Vec<u32>>,
                      rejection: Option<Rejection>| SourceReport {
            topic: topic.into(),
            age_s: time_ns.map(|time_ns| seconds(time_ns, now_ns)),
            processes: processes.into_iter().flatten().map(|id| process_report(id, of)).collect(),
            rejected: rejection.map(|rejection| rejection.to_string()),
        };
        vec![
            source(
                "setpoint",
                snapshot.setpoint.map(|setpoint| setpoint.time_ns),
                snapshot.setpoint_publishers,
                topics.map(|topics| topics.setpoint.publisher_process_ids()),
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

fn seconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

fn timing(snapshot: &Snapshot, rate_hz: f64) -> TimingReport {
    let (counters, window) = (&snapshot.status.counters, &snapshot.status.statistics.window);
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

fn legs(snapshot: &Snapshot) -> Vec<LegReport> {
    let Some(measurement) = &snapshot.measurement else { return vec![] };
    let rates = measurement.rate.map_or([None; LEGS], |rate| rate.map(Some));
    let numbers = measurement.length.iter().zip(rates).zip(&snapshot.force).take(LEGS);
    numbers
        .map(|((length, rate), force)| LegReport { length_m: *length, rate_m_s: rate, force_n: *force })
        .collect()
}

fn process_report(process_id: u32, publishers: Publishers) -> ProcessReport {
    let user = fs::metadata(format!("/proc/{process_id}")).map(|found| user_name(found.uid()));
    ProcessReport {
        process_id,
        command: command(process_id),
        user: user.unwrap_or_default(),
        is_ignored: process_id == publishers.ignored,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::control::controller::{Measurement, Setpoint};
    use crate::model::task::TaskState;

    #[test]
    fn what_is_no_number_survives_json() {
        let config = Config::parse(include_str!("../../../config/fried2008.toml"), "a test").unwrap();
        let mut snapshot = Snapshot {
            setpoint: Some(Setpoint::motion(1, TaskState::at_rest([f64::NAN; 6]))),
            measurement: Some(Measurement { length: [f64::NAN; 6], ..Measurement::default() }),
            ..Snapshot::default()
        };
        snapshot.status.pose_valid = 1;
        (snapshot.status.condition, snapshot.status.time_to_singularity_s) = (f64::INFINITY, f64::INFINITY);
        // Topics of nobody: the processes stay unknown.
        let mut source =
            StatusSource { topics: Some(None), ..StatusSource::new(Arc::new(Loaded::new(config))) };
        let line = source.answer(&snapshot, 2).to_line();
        let answer: AnswerLine = serde_json::from_str(&line).unwrap();
        let report = answer.status.unwrap();
        assert!(report.legs.len() == 6 && report.legs.iter().all(|leg| leg.length_m.is_nan()));
        assert_eq!((report.setpoint, report.condition, report.time_to_singularity_s), (None, None, None));
    }
}
