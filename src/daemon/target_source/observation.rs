//! The platform as a source of targets sees it: from the snapshots within the daemon, or from a status report outside.

use nalgebra::Vector3;

use crate::process_names::sentence;
use crate::snapshot::Snapshot;
use hexad_client::operator::protocol::AnswerLine;
use hexad_core::control::signals::inputs::SetpointKind;
use hexad_core::control::signals::state::State;
use hexad_core::model::rigid::Twist;
use hexad_core::model::task::{pose_of, task_coordinates};

/// State and poses at an instant.
#[derive(Clone, Debug, Default)]
pub struct Observation {
    /// CLOCK_MONOTONIC instant that the content is not older than \[ns\].
    pub time_ns: u64,
    /// State of the controller.
    pub state: State,
    /// Number of the diagnostic of the state.
    pub code: u32,
    /// Diagnostic of the state as a sentence.
    pub text: String,
    /// Measured X.
    pub pose: Option<[f64; 6]>,
    /// X of the reference under control, else of the platform.
    pub reference_or_measured_x: Option<[f64; 6]>,
    /// X of the newest setpoint.
    pub setpoint: Option<[f64; 6]>,
    /// X of the target that is followed or held.
    pub target: Option<[f64; 6]>,
}

impl Observation {
    /// Observation of a snapshot. `home` selects the angles.
    pub(crate) fn of_snapshot(snapshot: &Snapshot, home: &[f64; 6]) -> Self {
        let status = &snapshot.status;
        let diagnostic = status.diagnostic.diagnostic().unwrap_or_default();
        let setpoint = snapshot.setpoint.filter(|setpoint| setpoint.task.is_finite());
        let state = status.state().unwrap_or_default();
        let target = setpoint.filter(|setpoint| setpoint.kind == SetpointKind::Target && state.follows());
        let error =
            (status.error_valid == 1).then_some((status.orientation_error_rad, status.position_error_m));
        Self {
            time_ns: snapshot.time_ns,
            state,
            code: diagnostic.code as u32,
            text: sentence(&diagnostic),
            setpoint: setpoint.map(|setpoint| setpoint.task.x.into()),
            target: target.map(|setpoint| setpoint.task.x.into()),
            ..Self::default()
        }
        .with_pose((status.pose_valid == 1).then_some(status.x), error, home)
    }

    /// Observation of an answer to `status` that was requested at an instant \[ns\]; `None` if the answer has no status.
    pub fn of_answer(answer: &AnswerLine, requested_ns: u64, home: &[f64; 6]) -> Option<Self> {
        let report = answer.status.as_deref()?;
        let error = report.orientation_error_rad.zip(report.position_error_m);
        let observation = Self {
            time_ns: requested_ns,
            state: State::by_name(&answer.state).unwrap_or_default(),
            code: answer.diagnostic.code,
            text: answer.text.clone(),
            setpoint: report.setpoint,
            target: report.target,
            ..Self::default()
        };
        Some(observation.with_pose(report.pose, error, home))
    }

    /// Adds the measured pose and the reference, which is the pose plus its error.
    fn with_pose(self, pose: Option<[f64; 6]>, error: Option<([f64; 3], [f64; 3])>, home: &[f64; 6]) -> Self {
        let error = error.filter(|_| self.state.has_control()).map(|(angular, linear)| Twist {
            angular: Vector3::from(angular),
            linear: Vector3::from(linear),
        });
        let displaced =
            |(pose, error): ([f64; 6], Twist)| task_coordinates(&pose_of(&pose).displaced(&error), home);
        Self { reference_or_measured_x: pose.zip(error).map(displaced).or(pose), pose, ..self }
    }
}
