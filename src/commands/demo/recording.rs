//! What went over the topics during a demonstration, and how well it was tracked.

use crate::daemon::report::TrackingSum;
use crate::messages::{Bus, PortError, Subscriber};
use crate::messages::{ForceMessage, MeasuredMessage, SetpointMessage};
use crate::model::rigid::{Motion, Pose};
use crate::model::task::TaskState;

/// Messages kept between two polls: all that the topic can hold.
const DEPTH: usize = usize::MAX;

/// Subscribes to everything.
pub struct Recorder {
    setpoints: Subscriber<SetpointMessage>,
    measured: Subscriber<MeasuredMessage>,
    forces: Subscriber<ForceMessage>,
    recording: Recording,
}

/// All messages, in order.
#[derive(Default)]
pub struct Recording {
    pub setpoints: Vec<SetpointMessage>,
    pub measured: Vec<MeasuredMessage>,
    pub forces: Vec<ForceMessage>,
}

impl Recorder {
    /// Begins to listen.
    pub fn new(bus: &Bus) -> Result<Self, PortError> {
        Ok(Self {
            setpoints: bus.subscriber(DEPTH)?,
            measured: bus.subscriber(DEPTH)?,
            forces: bus.subscriber(DEPTH)?,
            recording: Recording::default(),
        })
    }

    /// Takes what has arrived.
    pub fn poll(&mut self) {
        self.recording.setpoints.extend(core::iter::from_fn(|| self.setpoints.receive()));
        self.recording.measured.extend(core::iter::from_fn(|| self.measured.receive()));
        self.recording.forces.extend(core::iter::from_fn(|| self.forces.receive()));
    }

    /// What was recorded.
    pub fn finish(mut self) -> Recording {
        self.poll();
        self.recording
    }
}

impl Recording {
    /// The instant that charts call zero: the first setpoint.
    pub fn start_ns(&self) -> u64 {
        self.setpoints.first().map_or(0, |message| message.header.time_ns)
    }

    /// Measurements with the desired motion at their instant, while setpoints cover it.
    pub fn pairs(&self) -> impl Iterator<Item = (&MeasuredMessage, TaskState)> {
        let mut newest = 0;
        self.measured.iter().filter_map(move |measured| {
            let time_ns = measured.header.time_ns;
            while self.setpoints.get(newest + 1).is_some_and(|next| next.header.time_ns <= time_ns) {
                newest += 1;
            }
            let setpoint = self.setpoints.get(newest)?;
            let age_ns = time_ns.checked_sub(setpoint.header.time_ns)?;
            // A source that paused longer than this was not a source at that instant.
            (age_ns < 100_000_000).then(|| (measured, task_state(setpoint).after(age_ns as f64 * 1e-9)))
        })
    }

    /// Error between the desired pose and the plant's true one, over the instants in motion; over all if
    /// there was no motion.
    pub fn tracking(&self) -> TrackingSum {
        let moves = |desired: &TaskState| desired.xd.amax() > 0.0;
        let at_rest = !self.pairs().any(|(_, desired)| moves(&desired));
        let mut sum = TrackingSum::default();
        for (measured, desired) in self.pairs().filter(|(_, desired)| at_rest || moves(desired)) {
            let error = measured_pose(measured).displacement_to(&desired.motion().pose);
            sum.add(error.linear.norm(), error.angular.norm());
        }
        sum
    }
}

/// X, X', X'' of a message.
pub fn task_state(message: &SetpointMessage) -> TaskState {
    TaskState { x: message.x.into(), xd: message.x_rate.into(), xdd: message.x_accel.into() }
}

/// The pose a plant says it has.
pub fn measured_pose(message: &MeasuredMessage) -> Pose {
    TaskState::at_rest(message.x).motion().pose
}

/// Desired motion of a setpoint.
pub fn desired_motion(message: &SetpointMessage) -> Motion {
    task_state(message).motion()
}
