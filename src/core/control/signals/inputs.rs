//! Inputs of the controller in one cycle: setpoint, measurement, request, and the processes that publish
//! them.

use serde::{Deserialize, Serialize};

use crate::control::signals::state::OperatorRequest;
use crate::model::LEGS;
use crate::model::task::TaskState;

/// Kind of a setpoint, with its number in the messages: which of its values hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u32)]
pub enum SetpointKind {
    /// X, X' and X'' of a motion at one instant.
    #[default]
    Motion = 0,
    /// X of a motion at one instant, without derivatives; the messages may arrive more slowly than the
    /// cycles.
    Pose = 1,
    /// X of a pose to move to and to stand at.
    Target = 2,
    /// The number in the message belongs to no kind: the setpoint is rejected.
    Unknown = 3,
}

impl SetpointKind {
    /// The kinds that a message may have, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Motion, Self::Pose, Self::Target];

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Motion => "motion",
            Self::Pose => "pose",
            Self::Target => "target",
            Self::Unknown => "unknown",
        }
    }
}

/// Task coordinates and their derivatives that a source requests for one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Setpoint {
    /// Which of the values hold, and for how long.
    pub kind: SetpointKind,
    /// Instant for which the setpoint holds, on the clock of the releases \[ns\].
    pub time_ns: u64,
    /// X, X', X'' at that instant.
    pub task: TaskState,
    /// Share of the limits of autonomous motions with which a target is approached, up to 1; 0 means 1.
    pub target_speed_share: f64,
}

impl Setpoint {
    /// X, X' and X'' of a motion at an instant.
    pub fn motion(time_ns: u64, task: TaskState) -> Self {
        Self { kind: SetpointKind::Motion, time_ns, task, target_speed_share: 0.0 }
    }
}

/// Lengths \[m\] and rates \[m/s\] of the legs at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Instant of the measurement, on the clock of the releases \[ns\].
    pub time_ns: u64,
    /// Measured leg lengths L, from base joint to platform joint \[m\].
    pub length_m: [f64; LEGS],
    /// Measured leg rates L' \[m/s\]; `None` if the driver does not measure them.
    pub rate_m_s: Option<[f64; LEGS]>,
    /// X by another sensor at the same instant; `None` if there is none.
    pub pose: Option<[f64; 6]>,
    /// Status of the drives.
    pub drives: DriveStatus,
}

impl AsRef<Self> for Measurement {
    fn as_ref(&self) -> &Self {
        self
    }
}

/// Status of the drives, reported by the driver. A set has one bit per leg, the lowest for leg 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveStatus {
    /// Set of enabled drives; `None` if not reported.
    pub enabled: Option<u32>,
    /// Set of open brakes; `None` if not reported.
    pub brake_open: Option<u32>,
    /// Set of drives with a fault, and [`DriveStatus::BUS_FAILED_BIT`]; `None` if not reported.
    pub fault: Option<u32>,
    /// Actual forces \[N\]; `None` if not reported.
    pub force_n: Option<[f64; LEGS]>,
}

impl DriveStatus {
    /// Bit of `fault` of a driver whose bus to the drives failed: the lengths beside it are no measurement.
    pub const BUS_FAILED_BIT: u32 = 1 << LEGS;

    /// The first drive that is not enabled, or whose brake is closed.
    pub(in crate::control) fn first_unready_leg(&self) -> Option<usize> {
        let ready = self.enabled.unwrap_or(u32::MAX) & self.brake_open.unwrap_or(u32::MAX);
        (0..LEGS).find(|leg| ready >> leg & 1 == 0)
    }

    pub(in crate::control) fn first_faulty_leg(&self) -> Option<usize> {
        (0..LEGS).find(|leg| self.fault.unwrap_or_default() >> leg & 1 == 1)
    }
}

/// IDs of the processes that publish an input: one whose messages are used, and one more that runs beside it;
/// 0 for none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Publishers {
    /// Process whose messages are used.
    pub used_pid: u32,
    /// Process whose messages are ignored.
    pub ignored_pid_or_0: u32,
}

/// Inputs of one cycle. Together with the state of the controller they determine its output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Input {
    /// The instant of release of this cycle, on the grid.
    pub release_ns: u64,
    /// Clock of the releases minus the daemon's clock \[ns\]; zero unless measurements release the cycles.
    pub clock_offset_ns: i64,
    /// The newest setpoint; `None` if none ever arrived.
    pub setpoint: Option<Setpoint>,
    /// The newest measurement; `None` if none ever arrived.
    pub measurement: Option<Measurement>,
    /// The newest request; `None` if none ever arrived. Each is carried out once.
    pub request: Option<OperatorRequest>,
    /// Processes that publish setpoints.
    pub setpoint_publishers: Publishers,
    /// Processes that publish measurements.
    pub measured_publishers: Publishers,
    /// Number of other poses with the measured leg lengths that the joints permit; [`Input::SEARCHING`] during their search.
    pub other_poses: u32,
    /// Whether cycles were missed since the last one, and the deployment treats that as a fault.
    pub had_faulty_overrun: bool,
}

impl Input {
    /// Value of `other_poses` during the search.
    pub const SEARCHING: u32 = u32::MAX;
}
