//! Cycles of a running daemon, assembled from its topics.

use std::collections::VecDeque;

use hexad_client::messages::{
    CycleMessage, ForceMessage, MeasuredMessage, PortError, SetpointMessage, StatisticsMessage,
    StatusMessage, Subscriber,
};
use hexad_core::control::controller::Output;
use hexad_core::control::sensing::localization::PlatformState;
use hexad_core::control::signals::errors::PoseError;
use hexad_core::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad_core::control::signals::limits::LimitSet;
use hexad_core::control::signals::state::State;
use hexad_core::control::signals::time::seconds_between;
use hexad_core::model::rigid::{Motion, Twist};
use hexad_core::model::task::TaskState;
use hexad_machine::config::Config;

/// Messages kept between two polls: the full capacity of the topic.
const TOPIC_DEPTH: usize = usize::MAX;

/// Longest time for which a setpoint counts as the reference \[s\].
const MAX_SETPOINT_AGE_S: f64 = 0.1;

/// Subscribers to the topics of a machine.
pub struct Topics {
    setpoints: Subscriber<SetpointMessage>,
    measured: Subscriber<MeasuredMessage>,
    forces: Subscriber<ForceMessage>,
    statuses: Subscriber<StatusMessage>,
    timings: Subscriber<StatisticsMessage>,
    /// Epoch of the last status.
    epoch: u64,
    /// The newest statistics.
    pub statistics: StatisticsMessage,
    /// For each topic: the newest message that is not newer than the last cycle, and later ones.
    setpoint: Newest<SetpointMessage>,
    measurement: Newest<MeasuredMessage>,
    /// Forces whose status has not arrived yet.
    pending: VecDeque<ForceMessage>,
}

/// Messages with an instant.
#[derive(Default)]
struct Newest<T> {
    message: Option<T>,
    later: VecDeque<T>,
}

impl<T: Copy> Newest<T> {
    /// The newest message that is not after an instant \[ns\].
    fn at(&mut self, now_ns: u64, instant_ns: fn(&T) -> u64) -> Option<T> {
        while let Some(next) = self.later.front().filter(|next| instant_ns(next) <= now_ns) {
            self.message = Some(*next);
            self.later.pop_front();
        }
        self.message
    }
}

impl Topics {
    /// Joins the topics of a machine.
    pub fn join(config: &Config) -> Result<Self, PortError> {
        let bus = config.join()?;
        Ok(Self {
            setpoints: bus.subscriber(TOPIC_DEPTH)?,
            measured: bus.subscriber(TOPIC_DEPTH)?,
            forces: bus.subscriber(TOPIC_DEPTH)?,
            statuses: bus.subscriber(TOPIC_DEPTH)?,
            timings: bus.subscriber(1)?,
            epoch: 0,
            statistics: StatisticsMessage::default(),
            setpoint: Newest::default(),
            measurement: Newest::default(),
            pending: VecDeque::new(),
        })
    }

    /// Cycles since the last call, each with its status.
    pub fn cycles(&mut self) -> Vec<(CycleMessage, StatusMessage)> {
        let statuses: Vec<_> = core::iter::from_fn(|| self.statuses.receive()).collect();
        // A status follows its force, so the forces of these statuses have arrived.
        // In simulated time the epoch of forces is the same after a restart. Their status decides.
        self.pending.extend(core::iter::from_fn(|| self.forces.receive_from_any()));
        self.setpoint.later.extend(core::iter::from_fn(|| self.setpoints.receive()));
        self.measurement.later.extend(core::iter::from_fn(|| self.measured.receive()));
        self.statistics = self.timings.receive_latest().unwrap_or(self.statistics);
        let mut cycles = vec![];
        for status in statuses {
            // Both have the same time stamp.
            let time_ns = status.header.time_ns;
            let is_first = core::mem::replace(&mut self.epoch, status.header.epoch) != status.header.epoch;
            if is_first {
                // Simulated time begins anew with the daemon: messages of before may be later.
                (self.setpoint, self.measurement) = Default::default();
            }
            let is_of_before =
                |it: &ForceMessage| it.header.time_ns < time_ns || is_first && it.header.time_ns != time_ns;
            while self.pending.front().is_some_and(is_of_before) {
                self.pending.pop_front();
            }
            let Some(force) = self.pending.front().filter(|force| force.header.time_ns == time_ns) else {
                continue;
            };
            let release_ns = force.release_ns;
            let setpoint = self.setpoint.at(release_ns, |message| message.header.time_ns);
            let measurement = self.measurement.at(release_ns, |message| message.header.time_ns);
            cycles.push((
                cycle(&status, &self.statistics, force, setpoint.as_ref(), measurement.as_ref()),
                status,
            ));
        }
        cycles
    }
}

/// A cycle with the data of its messages. The reference is not published; while active it equals the
/// setpoint. Wake-up and computation are the largest of the last complete second.
fn cycle(
    status: &StatusMessage,
    statistics: &StatisticsMessage,
    force: &ForceMessage,
    setpoint: Option<&SetpointMessage>,
    measurement: Option<&MeasuredMessage>,
) -> CycleMessage {
    let release_ns = force.release_ns;
    let setpoint = setpoint.map(Setpoint::from);
    let state = status.state().unwrap_or_default();
    let reference = setpoint.filter(|_| state == State::Active).and_then(|it| motion_at(&it, release_ns));
    let platform = (status.pose_valid == 1).then(|| PlatformState {
        pose: TaskState::at_rest(status.x).motion().pose,
        twist: Twist::from_vector(&status.twist.into()),
        condition: status.condition,
        time_to_singularity_s: status.time_to_singularity_s,
    });
    let error = (status.error_valid == 1).then(|| PoseError {
        pose: Twist { angular: status.orientation_error_rad.into(), linear: status.position_error_m.into() },
        twist: Twist::default(),
    });
    let output = Output {
        state,
        diagnostic: status.diagnostic.diagnostic().unwrap_or_default(),
        command_n: force.force_n,
        active_limits: LimitSet(status.active_limits),
        platform,
        error,
        reference,
        ..Output::default()
    };
    let measurement = measurement.map(Measurement::from);
    let input = Input { release_ns, setpoint, measurement, ..Input::default() };
    CycleMessage {
        cycle: status.counters.cycles,
        due_ns: release_ns,
        wakeup_ns: statistics.window.wakeup_ns.max,
        compute_ns: statistics.window.compute_ns.max,
        ..CycleMessage::new(&input, &output)
    }
}

fn motion_at(setpoint: &Setpoint, instant_ns: u64) -> Option<Motion> {
    let age_s = seconds_between(setpoint.time_ns, instant_ns);
    (0.0..MAX_SETPOINT_AGE_S).contains(&age_s).then(|| setpoint.task.after(age_s).motion())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_time_that_begins_anew_is_followed() {
        let name = format!("name = \"view-topics-{}\"", std::process::id());
        let machine = include_str!("../../../config/fried2008.toml").replace("name = \"fried2008\"", &name);
        let config =
            Config::parse(&format!("{machine}\n[realtime]\nrelease = \"lockstep\""), "a test").unwrap();
        let mut topics = Topics::join(&config).unwrap();
        for begin_ns in [9_000_000_000, 1_000_000] {
            let bus = config.join().unwrap();
            let mut forces = bus.publisher::<ForceMessage>().unwrap().with_reproducible_epoch();
            let mut statuses = bus.publisher::<StatusMessage>().unwrap();
            for time_ns in begin_ns..begin_ns + 3 {
                forces.publish(time_ns, ForceMessage::default()).unwrap();
                // The daemon is killed before the last status.
                if time_ns < begin_ns + 2 {
                    statuses.publish(time_ns, StatusMessage::default()).unwrap();
                }
            }
            assert_eq!(topics.cycles().len(), 2, "{begin_ns}");
        }
    }
}
