//! One cycle of the controller as a recording holds it: the whole input and output of `Controller::step`.

use iceoryx2::prelude::ZeroCopySend;

use super::DiagnosticRecord;
use super::layout::message;
use crate::control::controller::{Input, Measurement, Output, Setpoint, SetpointKind};
use crate::control::limits::LimitSet;
use crate::control::localization::PlatformState;
use crate::control::state::{OperatorRequest, Request, State};
use crate::control::tracking_error::TrackingError;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist, Wrench};
use crate::model::task::TaskState;

message! {
    /// One cycle of the controller: timing, input, output. Every number is that of the controller to the bit.
    CycleMessage = "hexad_cycle" {
        /// Number of the cycle, from 1.
        cycle: u64,
        /// CLOCK_MONOTONIC instant at which it was due.
        due_ns: u64 ["ns"],
        /// Release to the first instruction of the cycle.
        wakeup_ns: u64 ["ns"],
        /// First instruction of the cycle to its output.
        compute_ns: u64 ["ns"],
        /// Instant of release, for which it was computed.
        release_ns: u64 ["ns"],
        /// 1 if the I/O thread wrote no new input since the cycle before.
        io_late: u32,
        /// 1 if cycles were missed before it and the deployment makes that a fault.
        deadline_missed: u32,
        /// 1 if a setpoint has ever arrived; else the fields up to `setpoint_x_accel` are zero.
        has_setpoint: u32,
        /// Kind of the setpoint: 0 motion, 1 pose, 2 target, 3 unknown.
        setpoint_kind: u32,
        /// Instant for which the setpoint holds.
        setpoint_time_ns: u64 ["ns"],
        /// X of the setpoint.
        setpoint_x: [f64; 6] ["rad, m"],
        /// X' of the setpoint.
        setpoint_x_rate: [f64; 6] ["rad/s, m/s"],
        /// X'' of the setpoint.
        setpoint_x_accel: [f64; 6] ["rad/s^2, m/s^2"],
        /// 1 if a measurement has ever arrived; else the fields up to `measured_length_rate_m_s` are zero.
        has_measurement: u32,
        /// 1 if the driver measures rates.
        has_rate: u32,
        /// Instant of the measurement.
        measured_time_ns: u64 ["ns"],
        /// L.
        measured_length_m: [f64; 6] ["m"],
        /// L'.
        measured_length_rate_m_s: [f64; 6] ["m/s"],
        /// 1 if there is a request of an operator.
        has_request: u32,
        /// Number of the request.
        request: u32,
        /// Epoch of the message of the request.
        request_epoch: u64,
        /// Sequence number of that message.
        request_sequence: u64,
        /// Number of the state from this cycle on.
        state: u32,
        /// The limits that this cycle has reached, one bit each.
        active_limits: u32,
        /// Why the state is not active, or soon will not be.
        diagnostic: DiagnosticRecord,
        /// Epoch of the last request that was carried out or refused.
        answered_epoch: u64,
        /// Sequence number of that request.
        answered_sequence: u64,
        /// Why that request was refused.
        request_diagnostic: DiagnosticRecord,
        /// Gamma.
        force_n: [f64; 6] ["N"],
        /// Wrench of the forces minus that of the commanded ones, about C.
        wrench_error: [f64; 6] ["N m, N"],
        /// Cycles under control without a new valid measurement.
        missed_measurements: u64,
        /// Cycles under control without a new valid setpoint.
        missed_setpoints: u64,
        /// 1 if the pose of the platform is known; else the fields up to `time_to_singularity_s` are zero.
        has_platform: u32,
        /// 1 if `error` and `error_rate` are valid.
        has_error: u32,
        /// 1 if there is a reference: under control.
        has_reference: u32,
        /// Zero.
        reserved: u32,
        /// R, column by column.
        rotation: [f64; 9],
        /// C.
        position_m: [f64; 3] ["m"],
        /// omega, then v.
        twist: [f64; 6] ["rad/s, m/s"],
        /// Condition of the pose.
        condition: f64,
        /// Time to a singular pose if the motion continues.
        time_to_singularity_s: f64 ["s"],
        /// Tracking error: log(R_d R^T), then C_d - C.
        error: [f64; 6] ["rad, m"],
        /// Its rate: of angular velocity, then of velocity.
        error_rate: [f64; 6] ["rad/s, m/s"],
        /// R of the reference, column by column.
        reference_rotation: [f64; 9],
        /// C of the reference.
        reference_position_m: [f64; 3] ["m"],
        /// omega, then v, of the reference.
        reference_twist: [f64; 6] ["rad/s, m/s"],
        /// omega', then v', of the reference.
        reference_acceleration: [f64; 6] ["rad/s^2, m/s^2"],
    }
}

message! {
    /// Cycles that are missing in a recording.
    GapMessage = "hexad_gap" {
        /// Number of the first cycle that is missing.
        first_cycle: u64,
        /// Number of missing cycles.
        cycles: u64,
    }
}

impl CycleMessage {
    /// Message of a cycle without its timing.
    pub fn new(input: &Input, output: &Output) -> Self {
        let mut message = Self::default();
        message.set_input(input);
        message.set_output(output);
        message
    }

    fn set_input(&mut self, input: &Input) {
        (self.release_ns, self.deadline_missed) = (input.release_ns, u32::from(input.deadline_missed));
        if let Some(Setpoint { kind, time_ns, task }) = input.setpoint {
            (self.has_setpoint, self.setpoint_kind, self.setpoint_time_ns) = (1, kind as u32, time_ns);
            [self.setpoint_x, self.setpoint_x_rate, self.setpoint_x_accel] =
                [task.x, task.xd, task.xdd].map(Into::into);
        }
        if let Some(Measurement { time_ns, length, rate }) = input.measurement {
            (self.has_measurement, self.has_rate) = (1, u32::from(rate.is_some()));
            (self.measured_time_ns, self.measured_length_m) = (time_ns, length);
            self.measured_length_rate_m_s = rate.unwrap_or_default();
        }
        if let Some(OperatorRequest { request, message }) = input.request {
            (self.has_request, self.request) = (1, request as u32);
            (self.request_epoch, self.request_sequence) = message;
        }
    }

    fn set_output(&mut self, output: &Output) {
        (self.state, self.active_limits) = (output.state as u32, output.active_limits.0);
        self.diagnostic = output.diagnostic.into();
        (self.answered_epoch, self.answered_sequence) = output.answered;
        self.request_diagnostic = output.request_diagnostic.into();
        (self.force_n, self.wrench_error) = (output.force, output.wrench_error.vector().into());
        (self.missed_measurements, self.missed_setpoints) =
            (output.missed_measurements, output.missed_setpoints);
        if let Some(PlatformState { pose, twist, condition, time_to_singularity }) = &output.platform {
            self.has_platform = 1;
            (self.rotation, self.position_m) = pose_numbers(pose);
            self.twist = twist.vector().into();
            (self.condition, self.time_to_singularity_s) = (*condition, *time_to_singularity);
        }
        if let Some(TrackingError { pose, twist }) = &output.error {
            self.has_error = 1;
            [self.error, self.error_rate] = [pose, twist].map(|it| it.vector().into());
        }
        if let Some(Motion { pose, twist, acceleration }) = &output.reference {
            self.has_reference = 1;
            (self.reference_rotation, self.reference_position_m) = pose_numbers(pose);
            self.reference_twist = twist.vector().into();
            self.reference_acceleration = acceleration.vector().into();
        }
    }

    /// It with the number and the timing of another.
    pub fn timed_as(self, other: &Self) -> Self {
        let Self { cycle, due_ns, wakeup_ns, compute_ns, io_late, .. } = *other;
        Self { cycle, due_ns, wakeup_ns, compute_ns, io_late, ..self }
    }

    /// Input of the cycle; `None` if a number has no meaning.
    pub fn input(&self) -> Option<Input> {
        let setpoint = Setpoint {
            kind: SetpointKind::ALL
                .into_iter()
                .chain([SetpointKind::Unknown])
                .find(|kind| *kind as u32 == self.setpoint_kind)?,
            time_ns: self.setpoint_time_ns,
            task: TaskState {
                x: self.setpoint_x.into(),
                xd: self.setpoint_x_rate.into(),
                xdd: self.setpoint_x_accel.into(),
            },
        };
        let measurement = Measurement {
            time_ns: self.measured_time_ns,
            length: self.measured_length_m,
            rate: (self.has_rate == 1).then_some(self.measured_length_rate_m_s),
        };
        let request = if self.has_request == 1 {
            let message = (self.request_epoch, self.request_sequence);
            Some(OperatorRequest { request: Request::from_number(self.request)?, message })
        } else {
            None
        };
        Some(Input {
            release_ns: self.release_ns,
            setpoint: (self.has_setpoint == 1).then_some(setpoint),
            measurement: (self.has_measurement == 1).then_some(measurement),
            request,
            deadline_missed: self.deadline_missed == 1,
        })
    }

    /// Output of the cycle; `None` if a number has no meaning.
    pub fn output(&self) -> Option<Output> {
        let platform = PlatformState {
            pose: pose(&self.rotation, &self.position_m),
            twist: Twist::from_vector(&self.twist.into()),
            condition: self.condition,
            time_to_singularity: self.time_to_singularity_s,
        };
        let [error_pose, error_twist] =
            [self.error, self.error_rate].map(|numbers| Twist::from_vector(&numbers.into()));
        let reference = Motion {
            pose: pose(&self.reference_rotation, &self.reference_position_m),
            twist: Twist::from_vector(&self.reference_twist.into()),
            acceleration: Acceleration::from_vector(&self.reference_acceleration.into()),
        };
        Some(Output {
            state: State::from_number(self.state)?,
            diagnostic: self.diagnostic.diagnostic()?,
            answered: (self.answered_epoch, self.answered_sequence),
            request_diagnostic: self.request_diagnostic.diagnostic()?,
            force: self.force_n,
            wrench_error: Wrench::from_vector(&self.wrench_error.into()),
            active_limits: LimitSet(self.active_limits),
            missed_measurements: self.missed_measurements,
            missed_setpoints: self.missed_setpoints,
            platform: (self.has_platform == 1).then_some(platform),
            error: (self.has_error == 1).then_some(TrackingError { pose: error_pose, twist: error_twist }),
            reference: (self.has_reference == 1).then_some(reference),
        })
    }
}

fn pose_numbers(pose: &Pose) -> ([f64; 9], [f64; 3]) {
    let mut rotation = [0.0; 9];
    rotation.iter_mut().zip(pose.rotation.iter()).for_each(|(number, from)| *number = *from);
    (rotation, pose.position.into())
}

fn pose(rotation: &[f64; 9], position: &[f64; 3]) -> Pose {
    Pose {
        rotation: nalgebra::Matrix3::from_column_slice(rotation),
        position: nalgebra::Vector3::from_column_slice(position),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::layout::Declared as _;

    /// A message of which no two floats are alike; odd flags are set.
    fn message(flag: u32) -> CycleMessage {
        let mut bytes = vec![0; size_of::<CycleMessage>()];
        for (place, word) in bytes.chunks_exact_mut(8).enumerate() {
            word.copy_from_slice(&(place as f64 + 0.1).to_ne_bytes());
        }
        let message = CycleMessage::from_bytes(&bytes).unwrap();
        CycleMessage {
            io_late: 0,
            deadline_missed: flag,
            has_setpoint: flag,
            setpoint_kind: 3 * flag,
            has_measurement: flag,
            has_rate: flag,
            has_request: flag,
            request: 6 * flag,
            state: State::Parking as u32,
            active_limits: 77,
            diagnostic: DiagnosticRecord { code: 108, index: 3, value: f64::INFINITY, bound: -0.0 },
            request_diagnostic: DiagnosticRecord { code: 4, index: 1, value: 2.0, bound: 3.0 },
            has_platform: flag,
            has_error: flag,
            has_reference: flag,
            reserved: 0,
            ..message
        }
    }

    #[test]
    fn input_and_output_go_into_a_message_and_come_back_to_the_bit() {
        let full = message(1);
        let again = CycleMessage::new(&full.input().unwrap(), &full.output().unwrap());
        assert_eq!(again.timed_as(&full).bytes(), full.bytes());
        let empty = message(0);
        let (input, output) = (empty.input().unwrap(), empty.output().unwrap());
        assert_eq!((input.setpoint, input.measurement, input.request), (None, None, None));
        assert_eq!((output.platform, output.error, output.reference), (None, None, None));
        assert_eq!(CycleMessage { state: 99, ..full }.output(), None);
        assert_eq!(CycleMessage { request: 99, ..full }.input(), None);
        assert_eq!(CycleMessage::from_bytes(&full.bytes()[1..]), None);
    }
}
