//! The setpoint message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;
use hexad_core::control::signals::inputs::{Setpoint, SetpointKind};
use hexad_core::model::task::TaskState;

message! {
    /// Desired motion of the platform: X = alpha, beta, gamma, x, y, z and its derivatives.
    SetpointMessage = "hexad_setpoint" on "setpoint" schema 7 {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// 0: X, X' and X'' of a motion; 1: X alone, samples of a motion; 2: X alone, a pose to move to and hold.
        kind: u64,
        /// X.
        x: [f64; 6] ["rad, m"],
        /// X'.
        x_rate: [f64; 6] ["rad/s, m/s"],
        /// X''.
        x_accel: [f64; 6] ["rad/s^2, m/s^2"],
        /// Share of the limits of autonomous motions with which a target is approached, up to 1; 0 is all of them.
        target_speed: f64,
    }
}

impl From<&TaskState> for SetpointMessage {
    fn from(task: &TaskState) -> Self {
        Self { x: task.x.into(), x_rate: task.xd.into(), x_accel: task.xdd.into(), ..Self::default() }
    }
}

impl From<&Setpoint> for SetpointMessage {
    fn from(setpoint: &Setpoint) -> Self {
        let target_speed = setpoint.target_speed_share;
        Self { kind: setpoint.kind as u64, target_speed, ..Self::from(&setpoint.task) }
    }
}

impl From<&SetpointMessage> for Setpoint {
    fn from(message: &SetpointMessage) -> Self {
        let task = TaskState { x: message.x.into(), xd: message.x_rate.into(), xdd: message.x_accel.into() };
        let has_number = |kind: &SetpointKind| *kind as u64 == message.kind;
        let kind = SetpointKind::ALL.into_iter().find(has_number).unwrap_or(SetpointKind::Unknown);
        Self { kind, time_ns: message.header.time_ns, task, target_speed_share: message.target_speed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::Header;

    /// Numbers that differ: 1 to 18.
    fn message(kind: u64) -> SetpointMessage {
        let number = |first: usize| core::array::from_fn(|i| (first + i) as f64);
        let header = Header { time_ns: 77, ..Header::default() };
        SetpointMessage {
            header,
            kind,
            x: number(1),
            x_rate: number(7),
            x_accel: number(13),
            target_speed: 0.5,
        }
    }

    #[test]
    fn a_setpoint_contains_the_numbers_of_the_message_and_its_kind() {
        for (number, kind) in [
            (0, SetpointKind::Motion),
            (1, SetpointKind::Pose),
            (2, SetpointKind::Target),
            (3, SetpointKind::Unknown),
            (1 << 32, SetpointKind::Unknown),
            (u64::MAX, SetpointKind::Unknown),
        ] {
            let setpoint = Setpoint::from(&message(number));
            assert_eq!(
                (setpoint.kind, setpoint.time_ns, setpoint.target_speed_share),
                (kind, 77, 0.5),
                "{number}"
            );
            let TaskState { x, xd, xdd } = setpoint.task;
            let numbers: Vec<f64> = x.iter().chain(&xd).chain(&xdd).copied().collect();
            assert_eq!(numbers, (1..=18).map(f64::from).collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_message_of_a_setpoint_is_that_setpoint() {
        for kind in SetpointKind::ALL {
            let setpoint = Setpoint { kind, ..Setpoint::from(&message(0)) };
            let back = SetpointMessage { header: message(0).header, ..SetpointMessage::from(&setpoint) };
            assert_eq!((back.kind, Setpoint::from(&back)), (kind as u64, setpoint));
        }
        // A source that names no kind sends motions.
        assert_eq!(Setpoint::from(&SetpointMessage::default()).kind, SetpointKind::Motion);
        assert_eq!(SetpointMessage::from(&TaskState::default()).kind, 0);
    }
}
