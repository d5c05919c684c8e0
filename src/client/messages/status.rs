//! The status message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;
use super::{IoCounters, LoopCounters};
use hexad_core::control::controller::Output;
use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad_core::control::signals::inputs::Setpoint;
use hexad_core::control::signals::state::State;
use hexad_core::model::rigid::Twist;
use hexad_core::model::task::task_coordinates;

message! {
    /// Diagnostic: what happened, with the number that was found and its bound.
    DiagnosticRecord = "hexad_diagnostic" {
        /// Number of the `DiagnosticCode`.
        code: u32,
        /// Leg or axis, from 1; 0 if it concerns neither.
        index: u32,
        /// In the unit of the code; 0 if the code has no number.
        value: f64,
        /// What `value` is compared with.
        bound: f64,
    }
}

message! {
    /// State of the daemon, published every cycle.
    StatusMessage = "hexad_status" on "status" schema 7 {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// Number of the `State`.
        state: u32,
        /// Bits of the `Limit`s that this cycle has reached, or nearly.
        active_limits: u32,
        /// Why the state is not active, or soon will not be.
        diagnostic: DiagnosticRecord,
        /// The largest number once a request was carried out or refused.
        request_epoch: u64,
        /// Number that identifies that request.
        request_sequence: u64,
        /// Why that request was refused; code 0 if it was carried out.
        request_diagnostic: DiagnosticRecord,
        /// 1 if the fields from `x` to `time_to_singularity_s` are valid.
        pose_valid: u32,
        /// 1 if `position_error_m` and `orientation_error_rad` are valid.
        error_valid: u32,
        /// Measured pose as X, by forward kinematics.
        x: [f64; 6] ["rad, m"],
        /// Measured omega, then v, base axes.
        twist: [f64; 6] ["rad/s, m/s"],
        /// Condition of that pose.
        condition: f64,
        /// Time until a singular pose if the platform continues its motion; infinite if none is ahead.
        time_to_singularity_s: f64 ["s"],
        /// C_d - C.
        position_error_m: [f64; 3] ["m"],
        /// log(R_d R^T).
        orientation_error_rad: [f64; 3] ["rad"],
        /// Torque about C, then force, base axes, of the actuators minus that of the control law: zero unless forces are
        /// limited.
        wrench_error: [f64; 6] ["N m, N"],
        /// Cycles under control without a new valid measurement.
        missed_measurements: u64,
        /// Cycles under control without a new valid setpoint.
        missed_setpoints: u64,
        /// Counters of the real-time thread.
        counters: LoopCounters,
        /// Counters of the I/O thread.
        io: IoCounters,
        /// 1 while the platform follows a setpoint that does not change, and has been within the tolerance of it for the settling
        /// time (`[in_position]`).
        in_position: u32,
        /// 1 if `setpoint_position_error_m` and `setpoint_orientation_error_rad` are valid.
        setpoint_error_valid: u32,
        /// C of the setpoint minus C.
        setpoint_position_error_m: [f64; 3] ["m"],
        /// log(R_setpoint R^T).
        setpoint_orientation_error_rad: [f64; 3] ["rad"],
        /// `limits.scale` in force.
        limits_scale: f64,
    }
}

impl DiagnosticRecord {
    /// The diagnostic; `None` if no code has its number.
    pub fn diagnostic(&self) -> Option<Diagnostic> {
        let Self { code, index, value, bound } = *self;
        Some(Diagnostic { code: DiagnosticCode::from_number(code)?, value, bound, index })
    }
}

impl From<Diagnostic> for DiagnosticRecord {
    fn from(Diagnostic { code, value, bound, index }: Diagnostic) -> Self {
        Self { code: code as u32, index, value, bound }
    }
}

impl StatusMessage {
    /// Status of a cycle, without counters, `in_position` and `limits_scale`. `home` is the origin of the angles of X.
    pub fn new(home_x: &[f64; 6], output: &Output, setpoint: Option<&Setpoint>) -> Self {
        let mut message = Self {
            state: output.state as u32,
            active_limits: output.active_limits.0,
            diagnostic: output.diagnostic.into(),
            request_epoch: output.answered_message.epoch,
            request_sequence: output.answered_message.sequence,
            request_diagnostic: output.request_diagnostic.into(),
            missed_measurements: output.missed_measurements,
            missed_setpoints: output.missed_setpoints,
            wrench_error: output.wrench_error.vector().into(),
            ..Self::default()
        };
        if let Some(platform) = &output.platform {
            message.pose_valid = 1;
            message.x = task_coordinates(&platform.pose, home_x);
            message.twist = platform.twist.vector().into();
            message.condition = platform.condition;
            message.time_to_singularity_s = platform.time_to_singularity_s;
        }
        if let Some(error) = &output.error {
            message.error_valid = 1;
            message.position_error_m = error.pose.linear.into();
            message.orientation_error_rad = error.pose.angular.into();
        }
        let setpoint = setpoint.filter(|setpoint| setpoint.task.is_finite());
        if let Some((platform, setpoint)) = output.platform.as_ref().zip(setpoint) {
            let error = platform.pose.displacement_to(&setpoint.task.motion().pose);
            message.setpoint_error_valid = 1;
            message.setpoint_position_error_m = error.linear.into();
            message.setpoint_orientation_error_rad = error.angular.into();
        }
        message
    }

    /// Pose of the newest setpoint minus the measured pose; `None` if one of them is unknown.
    pub fn setpoint_error(&self) -> Option<Twist> {
        let Self { setpoint_orientation_error_rad: angular, setpoint_position_error_m: linear, .. } = *self;
        (self.setpoint_error_valid == 1).then(|| Twist { angular: angular.into(), linear: linear.into() })
    }

    /// State of the daemon; `None` if no state has its number.
    pub fn state(&self) -> Option<State> {
        State::from_number(self.state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_core::control::sensing::localization::PlatformState;
    use hexad_core::control::signals::errors::PoseError;
    use hexad_core::control::signals::limits::LimitSet;
    use hexad_core::model::rigid::Wrench;
    use hexad_core::model::task::TaskState;
    use nalgebra::Vector6;

    const HOME: [f64; 6] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];

    fn six(first: f64) -> [f64; 6] {
        core::array::from_fn(|k| first + k as f64)
    }

    /// An output of which no two numbers are alike.
    fn output() -> Output {
        let twist = |first: f64| Twist::from_vector(&Vector6::from(six(first)));
        Output {
            state: State::Active,
            diagnostic: Diagnostic { code: DiagnosticCode::SetpointTooFar, value: 1.0, bound: 2.0, index: 3 },
            answered_message: hexad_core::control::signals::state::MessageId { epoch: 4, sequence: 5 },
            request_diagnostic: Diagnostic::new(DiagnosticCode::NearSingular, 143.0, 100.0).at(6),
            command_n: six(10.0),
            wrench_error: Wrench::from_vector(&Vector6::from(six(20.0))),
            active_limits: LimitSet(6),
            missed_measurements: 7,
            missed_setpoints: 8,
            platform: Some(PlatformState {
                pose: TaskState::at_rest(HOME).motion().pose,
                twist: twist(30.0),
                condition: 50.0,
                time_to_singularity_s: 51.0,
            }),
            error: Some(PoseError { pose: twist(60.0), twist: twist(70.0) }),
            reference: None,
        }
    }

    #[test]
    fn a_status_contains_the_numbers_of_the_output() {
        let setpoint = Setpoint::motion(1, TaskState::at_rest(six(0.0)));
        let message = StatusMessage::new(&HOME, &output(), Some(&setpoint));
        assert_eq!([message.state, message.active_limits], [State::Active as u32, 6]);
        let diagnostic = DiagnosticRecord { code: 4, index: 3, value: 1.0, bound: 2.0 };
        assert_eq!(message.diagnostic, diagnostic);
        let request_diagnostic = DiagnosticRecord { code: 119, index: 7, value: 143.0, bound: 100.0 };
        assert_eq!(message.request_diagnostic, request_diagnostic);
        let records = [message.diagnostic, message.request_diagnostic];
        let diagnostics = records.map(|record| record.diagnostic());
        assert_eq!(diagnostics, [output().diagnostic, output().request_diagnostic].map(Some));
        assert_eq!(DiagnosticRecord { code: 99, ..diagnostic }.diagnostic(), None);
        assert_eq!([message.request_epoch, message.request_sequence], [4, 5]);
        assert_eq!([message.missed_measurements, message.missed_setpoints], [7, 8]);
        assert_eq!([message.condition, message.time_to_singularity_s], [50.0, 51.0]);
        assert_eq!([message.wrench_error, message.twist], [six(20.0), six(30.0)]);
        assert_eq!([message.pose_valid, message.error_valid, message.setpoint_error_valid], [1; 3]);
        let error: [f64; 3] = core::array::from_fn(|k| six(0.0)[3 + k] - HOME[3 + k]);
        assert!(message.setpoint_position_error_m.iter().zip(error).all(|(a, b)| (a - b).abs() < 1e-12));
        assert!(message.x.iter().zip(HOME).all(|(x, home)| (x - home).abs() < 1e-12), "{:?}", message.x);
        assert_eq!(
            [message.orientation_error_rad, message.position_error_m],
            [[60.0, 61.0, 62.0], [63.0, 64.0, 65.0]]
        );
        let unknown = StatusMessage::new(&HOME, &Output::default(), Some(&setpoint));
        assert_eq!([unknown.pose_valid, unknown.error_valid, unknown.setpoint_error_valid], [0; 3]);
        let unknown = StatusMessage::new(&HOME, &output(), None);
        assert_eq!((unknown.setpoint_error_valid, unknown.setpoint_error()), (0, None));
    }

    /// A monitor in another language reads one status per cycle.
    #[test]
    fn a_status_has_less_than_1_kb() {
        assert!(size_of::<StatusMessage>() < 1000, "{}", size_of::<StatusMessage>());
    }
}
