//! Recording of the topics during a demonstration, and its tracking error.

use hexad_client::messages::{Bus, PortError, Subscriber};
use hexad_client::messages::{ForceMessage, MeasuredMessage, SetpointMessage};
use hexad_core::control::signals::inputs::Setpoint;
use hexad_core::control::signals::time::seconds_between;
use hexad_core::model::rigid::{Motion, Pose};
use hexad_core::model::task::TaskState;
use hexad_daemon::report::TrackingSum;

/// Messages kept between two polls: the full capacity of the topic.
const TOPIC_DEPTH: usize = usize::MAX;

/// Subscriber to setpoints, measurements and forces, which keeps every message.
pub struct TopicRecorder {
    setpoints: Subscriber<SetpointMessage>,
    measured: Subscriber<MeasuredMessage>,
    forces: Subscriber<ForceMessage>,
    recording: Recording,
}

/// All messages of a demonstration, in order.
#[derive(Default)]
pub struct Recording {
    pub setpoints: Vec<SetpointMessage>,
    pub measured: Vec<MeasuredMessage>,
    pub forces: Vec<ForceMessage>,
}

impl TopicRecorder {
    /// Subscribes to the topics of a machine.
    pub fn new(bus: &Bus) -> Result<Self, PortError> {
        Ok(Self {
            setpoints: bus.subscriber(TOPIC_DEPTH)?,
            measured: bus.subscriber(TOPIC_DEPTH)?,
            forces: bus.subscriber(TOPIC_DEPTH)?,
            recording: Recording::default(),
        })
    }

    /// Takes the messages that have arrived since the last call.
    pub fn poll(&mut self) {
        self.recording.setpoints.extend(core::iter::from_fn(|| self.setpoints.receive()));
        self.recording.measured.extend(core::iter::from_fn(|| self.measured.receive()));
        self.recording.forces.extend(core::iter::from_fn(|| self.forces.receive()));
    }

    /// The recording, including the last messages.
    pub fn finish(mut self) -> Recording {
        self.poll();
        self.recording
    }
}

impl Recording {
    /// Instant of the first setpoint, which is time zero of the charts.
    pub fn start_ns(&self) -> u64 {
        self.setpoints.first().map_or(0, |message| message.header.time_ns)
    }

    /// Measurements with the desired motion at their instant, as far as setpoints cover it.
    pub fn pairs(&self) -> impl Iterator<Item = (&MeasuredMessage, TaskState)> {
        with_desired(&self.setpoints, &self.measured, |message| message.header.time_ns)
    }

    /// Applied forces with the desired motion that they belong to: that in the middle of the period for which they are
    /// held.
    pub fn force_pairs(&self, period_ns: u64) -> impl Iterator<Item = (&ForceMessage, TaskState)> {
        let middle_ns = move |message: &ForceMessage| message.release_ns.saturating_add(period_ns / 2);
        with_desired(&self.setpoints, &self.forces, middle_ns).filter(|(force, _)| force.valid == 1)
    }

    /// Error between the desired pose and the plant's true one, over the instants in motion; over all if
    /// there was no motion.
    pub fn tracking(&self) -> TrackingSum {
        let moves = |desired: &TaskState| desired.xd.amax() > 0.0;
        let at_rest = !self.pairs().any(|(_, desired)| moves(&desired));
        let mut sum = TrackingSum::default();
        for (measured, desired) in self.pairs().filter(|(_, desired)| at_rest || moves(desired)) {
            let error = true_pose(measured).displacement_to(&desired.motion().pose);
            sum.add(error.linear.norm(), error.angular.norm());
        }
        sum
    }
}

/// Messages with the desired motion at an instant of each, as far as setpoints cover it.
fn with_desired<'a, T>(
    setpoints: &'a [SetpointMessage],
    messages: &'a [T],
    instant_ns: impl Fn(&T) -> u64 + 'a,
) -> impl Iterator<Item = (&'a T, TaskState)> {
    let mut newest = 0;
    messages.iter().filter_map(move |message| {
        let time_ns = instant_ns(message);
        while setpoints.get(newest + 1).is_some_and(|next| next.header.time_ns <= time_ns) {
            newest += 1;
        }
        let setpoint = setpoints.get(newest)?;
        let age_s = seconds_between(setpoint.header.time_ns, time_ns);
        // After a longer pause the source counts as absent at that instant.
        (0.0..0.1).contains(&age_s).then(|| (message, Setpoint::from(setpoint).task.after(age_s)))
    })
}

/// True pose of the plant in a message.
pub fn true_pose(message: &MeasuredMessage) -> Pose {
    TaskState::at_rest(message.x).motion().pose
}

/// Desired motion of a setpoint message.
pub fn desired_motion(message: &SetpointMessage) -> Motion {
    Setpoint::from(message).task.motion()
}
