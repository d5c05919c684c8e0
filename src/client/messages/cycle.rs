//! One cycle of the controller as a recording holds it: the whole input and output of `Controller::step`.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;
use super::{DiagnosticRecord, MeasuredMessage};
use hexad_core::control::controller::Output;
use hexad_core::control::sensing::localization::PlatformState;
use hexad_core::control::signals::errors::PoseError;
use hexad_core::control::signals::inputs::{Input, Measurement, Publishers, Setpoint, SetpointKind};
use hexad_core::control::signals::limits::LimitSet;
use hexad_core::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad_core::model::rigid::{Acceleration, Motion, Pose, Twist, Wrench};
use hexad_core::model::task::TaskState;

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
        /// The clock of the releases less the daemon's, two's complement: not zero where measurements release the cycles.
        clock_offset_ns: u64 ["ns"],
        /// Process whose setpoints count; 0 if there is none.
        setpoint_process: u32,
        /// Process whose setpoints are ignored.
        setpoint_process_ignored: u32,
        /// Process whose measurements count.
        measured_process: u32,
        /// Process whose measurements are ignored.
        measured_process_ignored: u32,
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
        /// Share of the limits with which a target is approached; 0 is all.
        setpoint_target_speed: f64,
        /// 1 if a measurement has ever arrived; else the fields up to `actual_force_n` are zero.
        has_measurement: u32,
        /// 1 if the driver measures rates.
        rates_valid: u32,
        /// Instant of the measurement.
        measured_time_ns: u64 ["ns"],
        /// L.
        measured_length_m: [f64; 6] ["m"],
        /// L'.
        measured_length_rate_m_s: [f64; 6] ["m/s"],
        /// X by another sensor.
        measured_x: [f64; 6] ["rad, m"],
        /// 1 if `measured_x` is valid.
        pose_valid: u32,
        /// What of the drives was reported, as in the measured message.
        drive_valid: u32,
        /// A bit for each drive that is enabled.
        drive_enabled: u32,
        /// A bit for each brake that is open.
        brake_open: u32,
        /// A bit for each drive with a fault.
        drive_fault: u32,
        /// Number of other poses with the measured lengths; 4294967295 during their search.
        other_poses: u32,
        /// Forces that act.
        actual_force_n: [f64; 6] ["N"],
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
        (self.release_ns, self.deadline_missed) = (input.release_ns, u32::from(input.had_faulty_overrun));
        self.other_poses = input.other_poses;
        self.clock_offset_ns = input.clock_offset_ns.cast_unsigned();
        let Publishers { used_pid, ignored_pid_or_0 } = input.setpoint_publishers;
        (self.setpoint_process, self.setpoint_process_ignored) = (used_pid, ignored_pid_or_0);
        let Publishers { used_pid, ignored_pid_or_0 } = input.measured_publishers;
        (self.measured_process, self.measured_process_ignored) = (used_pid, ignored_pid_or_0);
        if let Some(Setpoint { kind, time_ns, task, target_speed_share }) = input.setpoint {
            self.setpoint_target_speed = target_speed_share;
            (self.has_setpoint, self.setpoint_kind, self.setpoint_time_ns) = (1, kind as u32, time_ns);
            [self.setpoint_x, self.setpoint_x_rate, self.setpoint_x_accel] =
                [task.x, task.xd, task.xdd].map(Into::into);
        }
        if let Some(measurement) = &input.measurement {
            (self.has_measurement, self.measured_time_ns) = (1, measurement.time_ns);
            let message = MeasuredMessage::from(measurement);
            (self.measured_length_m, self.measured_length_rate_m_s) =
                (message.length_m, message.length_rate_m_s);
            (self.rates_valid, self.pose_valid) = (message.rates_valid, message.pose_valid);
            (self.measured_x, self.actual_force_n) = (message.x, message.force_n);
            (self.drive_valid, self.drive_enabled) = (message.drive_valid, message.drive_enabled);
            (self.brake_open, self.drive_fault) = (message.brake_open, message.drive_fault);
        }
        if let Some(OperatorRequest { request, message }) = input.request {
            (self.has_request, self.request) = (1, request as u32);
            (self.request_epoch, self.request_sequence) = (message.epoch, message.sequence);
        }
    }

    fn set_output(&mut self, output: &Output) {
        (self.state, self.active_limits) = (output.state as u32, output.active_limits.0);
        self.diagnostic = output.diagnostic.into();
        let MessageId { epoch, sequence } = output.answered_message;
        (self.answered_epoch, self.answered_sequence) = (epoch, sequence);
        self.request_diagnostic = output.request_diagnostic.into();
        (self.force_n, self.wrench_error) = (output.command_n, output.wrench_error.vector().into());
        (self.missed_measurements, self.missed_setpoints) =
            (output.missed_measurements, output.missed_setpoints);
        if let Some(PlatformState { pose, twist, condition, time_to_singularity_s }) = &output.platform {
            self.has_platform = 1;
            (self.rotation, self.position_m) = pose_numbers(pose);
            self.twist = twist.vector().into();
            (self.condition, self.time_to_singularity_s) = (*condition, *time_to_singularity_s);
        }
        if let Some(PoseError { pose, twist }) = &output.error {
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
    pub fn with_number_and_timing_of(self, other: &Self) -> Self {
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
            target_speed_share: self.setpoint_target_speed,
        };
        let measured = MeasuredMessage {
            length_m: self.measured_length_m,
            length_rate_m_s: self.measured_length_rate_m_s,
            pose_valid: self.pose_valid,
            rates_valid: self.rates_valid,
            x: self.measured_x,
            drive_valid: self.drive_valid,
            drive_enabled: self.drive_enabled,
            brake_open: self.brake_open,
            drive_fault: self.drive_fault,
            force_n: self.actual_force_n,
            ..MeasuredMessage::default()
        };
        let measurement = Measurement { time_ns: self.measured_time_ns, ..Measurement::from(&measured) };
        let request = if self.has_request == 1 {
            let message = MessageId { epoch: self.request_epoch, sequence: self.request_sequence };
            Some(OperatorRequest { request: Request::from_number(self.request)?, message })
        } else {
            None
        };
        Some(Input {
            release_ns: self.release_ns,
            clock_offset_ns: self.clock_offset_ns.cast_signed(),
            setpoint: (self.has_setpoint == 1).then_some(setpoint),
            measurement: (self.has_measurement == 1).then_some(measurement),
            request,
            setpoint_publishers: Publishers {
                used_pid: self.setpoint_process,
                ignored_pid_or_0: self.setpoint_process_ignored,
            },
            measured_publishers: Publishers {
                used_pid: self.measured_process,
                ignored_pid_or_0: self.measured_process_ignored,
            },
            had_faulty_overrun: self.deadline_missed == 1,
            other_poses: self.other_poses,
        })
    }

    /// Output of the cycle; `None` if a number has no meaning.
    pub fn output(&self) -> Option<Output> {
        let platform = PlatformState {
            pose: pose(&self.rotation, &self.position_m),
            twist: Twist::from_vector(&self.twist.into()),
            condition: self.condition,
            time_to_singularity_s: self.time_to_singularity_s,
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
            answered_message: MessageId { epoch: self.answered_epoch, sequence: self.answered_sequence },
            request_diagnostic: self.request_diagnostic.diagnostic()?,
            command_n: self.force_n,
            wrench_error: Wrench::from_vector(&self.wrench_error.into()),
            active_limits: LimitSet(self.active_limits),
            missed_measurements: self.missed_measurements,
            missed_setpoints: self.missed_setpoints,
            platform: (self.has_platform == 1).then_some(platform),
            error: (self.has_error == 1).then_some(PoseError { pose: error_pose, twist: error_twist }),
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
mod tests;
