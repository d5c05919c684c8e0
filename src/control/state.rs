//! States, operator's requests and causes by number, as the messages carry them.
//!
//! # What the actuators get
//!
//! | state | force | leaves it |
//! | --- | --- | --- |
//! | off | not valid: brake | the pose is known: standby |
//! | standby | not valid: brake | `engage`; the pose is lost: off |
//! | engaging | controlled, from where the platform stands onto the setpoint | on the setpoint: active |
//! | active | controlled, on the setpoint | `stop`, `park`, a setpoint that ended or was lost: stopping |
//! | stopping | controlled, to rest along the present motion | at rest: standby, parking or fault |
//! | parking | controlled, to the home pose | at home: standby |
//! | fault | not valid: brake | `clear`: off |
//!
//! `off` leads to off and `estop` to fault from everywhere, within the cycle. There is no gravity support
//! without control: whoever does not get a valid force brakes.

/// What the daemon does with the platform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum State {
    /// No force; where the platform is is not known.
    #[default]
    Off = 0,
    /// No force; ready to engage.
    Standby = 1,
    /// From where the platform stands onto the setpoint.
    Engaging = 2,
    /// On the setpoint.
    Active = 3,
    /// To rest along the present motion.
    Stopping = 4,
    /// To the home pose.
    Parking = 5,
    /// No force until cleared.
    Fault = 6,
}

impl State {
    /// Every state, in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Off,
        Self::Standby,
        Self::Engaging,
        Self::Active,
        Self::Stopping,
        Self::Parking,
        Self::Fault,
    ];

    /// Whether the platform is under control: forces are valid in these states and in no other.
    pub fn controls(self) -> bool {
        matches!(self, Self::Engaging | Self::Active | Self::Stopping | Self::Parking)
    }

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Standby => "standby",
            Self::Engaging => "engaging",
            Self::Active => "active",
            Self::Stopping => "stopping",
            Self::Parking => "parking",
            Self::Fault => "fault",
        }
    }

    /// Reads the number of a message.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|state| *state as u32 == number)
    }
}

/// What an operator asks for. Of several within one cycle the last in this order counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum Request {
    /// Take control and follow the setpoint.
    Engage = 1,
    /// Leave the fault.
    Clear = 2,
    /// Come to rest, go home, let go.
    Park = 3,
    /// Come to rest, let go.
    Stop = 4,
    /// Let go at once.
    Off = 5,
    /// Let go at once, and stay so until cleared.
    Estop = 6,
}

impl Request {
    /// Every request, the weakest first.
    pub const ALL: [Self; 6] = [Self::Engage, Self::Clear, Self::Park, Self::Stop, Self::Off, Self::Estop];

    /// Whether carrying it out may begin to move the platform.
    pub fn takes_force(self) -> bool {
        matches!(self, Self::Engage | Self::Park)
    }

    /// Name for people; the command of the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Engage => "engage",
            Self::Clear => "clear",
            Self::Park => "park",
            Self::Stop => "stop",
            Self::Off => "off",
            Self::Estop => "estop",
        }
    }

    /// Reads the number of a message.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|request| *request as u32 == number)
    }
}

/// How the daemon answers a fault of a platform under control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// Not a fault.
    None,
    /// Comes to rest under control, then lets go.
    Stop,
    /// Lets go at once: control itself is not to be trusted.
    Brake,
}

macro_rules! causes {
    ($($(#[$doc:meta])* $variant:ident = $number:literal, $reaction:ident, $name:literal, $remedy:literal;)*) => {
        /// Why the platform is not under control, or will not be for long. Below 100: no fault.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum Cause { $($(#[$doc])* $variant = $number,)* }

        impl Cause {
            /// Every cause, in the order of their numbers.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// Name for people.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// What the operator does about it.
            pub fn remedy(self) -> &'static str {
                match self { $(Self::$variant => $remedy,)* }
            }

            /// What the daemon does about it.
            pub fn reaction(self) -> Reaction {
                match self { $(Self::$variant => Reaction::$reaction,)* }
            }
        }
    };
}

causes! {
    /// Nothing stands in the way.
    #[default]
    None = 0, None, "none", "nothing";
    /// No measurement has arrived yet.
    NoMeasurement = 1, None, "no measurement", "start the driver or the plant";
    /// No setpoint has arrived yet.
    NoSetpoint = 2, None, "no setpoint", "start a setpoint source, then engage";
    /// The pose is being found from the measured lengths, a bounded step per cycle.
    FindingPose = 3, None, "finding the pose", "wait";
    /// The setpoint is further from the platform than the engage tolerance, or passing by.
    SetpointTooFar = 4, None, "setpoint too far from the platform", "start the setpoints where the platform stands";
    /// The setpoint source stopped while its setpoint was at rest.
    SetpointEnded = 5, None, "setpoint source ended at rest", "start a setpoint source, then engage";
    /// The daemon is stopping.
    Stopping = 6, None, "daemon stopping", "nothing";
    /// Everything is ready and nobody has asked to engage.
    NotAsked = 7, None, "ready to engage", "engage";
    /// An operator asked for it.
    Asked = 8, None, "asked for", "nothing";
    /// What was asked for is not possible in this state.
    NotNow = 9, None, "not possible in this state", "see the table of states";
    /// The setpoint stopped arriving while it was in motion.
    SetpointLost = 100, Stop, "setpoint lost in motion", "see why its source ended";
    /// Measurements stopped arriving.
    MeasurementLost = 101, Brake, "measurement lost", "see why the driver ended";
    /// A setpoint held a number that is not finite.
    SetpointNotFinite = 102, Stop, "setpoint not finite", "correct the setpoint source";
    /// A measurement held a number that is not finite.
    MeasurementNotFinite = 103, Brake, "measurement not finite", "see the encoders and the driver";
    /// Forward kinematics did not converge on the measured lengths.
    PoseNotFound = 104, Brake, "pose not found from lengths", "compare the lengths with the machine file";
    /// The measured lengths moved further than the actuators can.
    MeasurementJumped = 105, Brake, "measured lengths jumped", "see the encoders and the driver";
    /// The pose is singular: no forces balance the load.
    SingularPose = 106, Brake, "singular pose", "move the platform away by hand";
    /// The force was not finite.
    ForceNotFinite = 107, Brake, "force not finite", "report it: it is a fault of hexad";
    /// The platform was further from its reference than the following-error limit.
    OffPath = 108, Brake, "platform off the path", "look for a collision, a payload, a drive without force";
    /// Cycles were missed, and `realtime.on_overrun` is `fault`.
    DeadlineMissed = 109, Stop, "deadline missed", "see the worst cycles in the status; hexad doctor";
    /// An operator's emergency stop.
    EmergencyStop = 110, Brake, "emergency stop", "clear when it is safe";
    /// A setpoint beyond the stroke or the rate of a leg.
    SetpointOutOfReach = 111, Stop, "setpoint beyond the stroke or rate of a leg", "correct the trajectory";
    /// A setpoint that does not continue the one before it: X, X' and X'' do not belong together.
    SetpointJumped = 112, Stop, "setpoint jumped", "send X, X' and X'' of one smooth motion";
    /// A measured length beyond what the leg has.
    LengthOutOfStroke = 113, Brake, "measured length beyond the stroke", "see the encoders, compare with the machine file";
    /// A measured rate that is not that of the lengths.
    RateInconsistent = 114, Brake, "measured rate does not belong to the lengths", "see the units and signs of the driver";
}

impl Cause {
    /// Whether it takes control away for good.
    pub fn is_fault(self) -> bool {
        self as u32 >= 100
    }

    /// Reads the number of a message.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.iter().copied().find(|cause| *cause as u32 == number)
    }
}
