//! The setpoint message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;
use crate::control::controller::{Setpoint, SetpointKind};
use crate::model::task::TaskState;

message! {
    /// Desired motion of the platform: X = alpha, beta, gamma, x, y, z and its derivatives.
    SetpointMessage = "hexad_setpoint" on "setpoint" schema 6 {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// 0: X, X' and X'' of a motion; 1: X alone, samples of a motion; 2: X alone, a pose to move to and stand at.
        kind: u64,
        /// X.
        x: [f64; 6] ["rad, m"],
        /// X'.
        x_rate: [f64; 6] ["rad/s, m/s"],
        /// X''.
        x_accel: [f64; 6] ["rad/s^2, m/s^2"],
    }
}

impl From<&TaskState> for SetpointMessage {
    fn from(task: &TaskState) -> Self {
        Self { x: task.x.into(), x_rate: task.xd.into(), x_accel: task.xdd.into(), ..Self::default() }
    }
}

impl From<&SetpointMessage> for Setpoint {
    fn from(message: &SetpointMessage) -> Self {
        let task = TaskState { x: message.x.into(), xd: message.x_rate.into(), xdd: message.x_accel.into() };
        let kind = match message.kind {
            0 => SetpointKind::Motion,
            1 => SetpointKind::Pose,
            2 => SetpointKind::Target,
            _ => SetpointKind::Unknown,
        };
        Self { kind, time_ns: message.header.time_ns, task }
    }
}
