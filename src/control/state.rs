//! States and faults by number, as the force and status messages carry them.
//!
//! This is the first form: the loop either controls or says why not. Everything that needs an operator
//! (engage, park, latched faults) is not here yet.

/// What the daemon does with the platform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum State {
    /// No force is valid; the drives are expected to brake.
    #[default]
    Waiting = 0,
    /// Forces are valid and follow the setpoint.
    Active = 1,
}

impl State {
    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Active => "active",
        }
    }

    /// Reads the number of a message.
    pub fn from_number(number: u32) -> Option<Self> {
        [Self::Waiting, Self::Active].into_iter().find(|state| *state as u32 == number)
    }
}

/// Why no force is valid. Below 100: normal while starting and stopping. From 100 on: a fault when it
/// takes the force away from a platform that was under control.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Cause {
    /// Nothing stands in the way.
    #[default]
    None = 0,
    /// No measurement has arrived yet.
    NoMeasurement = 1,
    /// No setpoint has arrived yet.
    NoSetpoint = 2,
    /// The pose is being found from the measured lengths, a bounded step per cycle.
    FindingPose = 3,
    /// The setpoint is further from the platform than the engage tolerance, or passing by.
    SetpointTooFar = 4,
    /// The setpoint source stopped while its setpoint was at rest.
    SetpointEnded = 5,
    /// The daemon is stopping.
    Stopping = 6,
    /// The setpoint stopped arriving while it was in motion.
    SetpointLost = 100,
    /// Measurements stopped arriving.
    MeasurementLost = 101,
    /// A setpoint held a number that is not finite.
    SetpointNotFinite = 102,
    /// A measurement held a number that is not finite.
    MeasurementNotFinite = 103,
    /// Forward kinematics did not converge on the measured lengths.
    PoseNotFound = 104,
    /// The measured lengths moved further in one cycle than the pose can be followed.
    MeasurementJumped = 105,
    /// The pose is singular: no forces balance the load.
    SingularPose = 106,
    /// The force was not finite.
    ForceNotFinite = 107,
    /// The platform was further from the setpoint than the following-error limit.
    OffPath = 108,
    /// Cycles were missed, and `realtime.on_overrun` is `fault`.
    DeadlineMissed = 109,
}

impl Cause {
    /// Every cause, in the order of their numbers.
    pub const ALL: [Self; 17] = [
        Self::None,
        Self::NoMeasurement,
        Self::NoSetpoint,
        Self::FindingPose,
        Self::SetpointTooFar,
        Self::SetpointEnded,
        Self::Stopping,
        Self::SetpointLost,
        Self::MeasurementLost,
        Self::SetpointNotFinite,
        Self::MeasurementNotFinite,
        Self::PoseNotFound,
        Self::MeasurementJumped,
        Self::SingularPose,
        Self::ForceNotFinite,
        Self::OffPath,
        Self::DeadlineMissed,
    ];

    /// Whether losing control for this cause is a fault.
    pub fn is_fault(self) -> bool {
        self as u32 >= 100
    }

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::NoMeasurement => "no measurement",
            Self::NoSetpoint => "no setpoint",
            Self::FindingPose => "finding the pose",
            Self::SetpointTooFar => "setpoint too far from the platform",
            Self::SetpointEnded => "setpoint source ended at rest",
            Self::Stopping => "daemon stopping",
            Self::SetpointLost => "setpoint lost in motion",
            Self::MeasurementLost => "measurement lost",
            Self::SetpointNotFinite => "setpoint not finite",
            Self::MeasurementNotFinite => "measurement not finite",
            Self::PoseNotFound => "pose not found from lengths",
            Self::MeasurementJumped => "measured lengths jumped",
            Self::SingularPose => "singular pose",
            Self::ForceNotFinite => "force not finite",
            Self::OffPath => "platform off the path",
            Self::DeadlineMissed => "deadline missed",
        }
    }

    /// Reads the number of a message.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|cause| *cause as u32 == number)
    }
}
