//! States, operator's requests and causes by number, as the messages carry them.
//!
//! # What the actuators get
//!
//! | state | force | leaves it |
//! | --- | --- | --- |
//! | off | not valid: brake | the pose is known: standby; if off was asked for, `clear` or `engage` |
//! | standby | not valid: brake | `engage`; `park`: parking; the pose is lost: off |
//! | engaging | controlled, from where the platform stands onto the setpoint | on the setpoint: active |
//! | active | controlled, on the setpoint | `stop`, `park`, a setpoint that ended or was lost: stopping |
//! | stopping | controlled, to rest along the present motion | at rest: standby, parking or fault |
//! | parking | controlled, to the home pose | at home: off |
//! | fault | not valid: brake | `clear`: off, and on to standby |
//!
//! `off` leads to off and `estop` to fault from everywhere, within the cycle; out of fault leads only
//! `clear`. There is no gravity support without control: whoever does not get a valid force brakes.

/// What the daemon does with the platform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum State {
    /// No force: where the platform is is not known, or an operator wants it off.
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
    pub const ALL: [Self; 7] =
        [Self::Off, Self::Standby, Self::Engaging, Self::Active, Self::Stopping, Self::Parking, Self::Fault];

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

macro_rules! reaction {
    (None) => {
        "goes on"
    };
    (Stop) => {
        "stops under control, then fault"
    };
    (Brake) => {
        "lets go: fault"
    };
}

macro_rules! causes {
    ($($(#[$doc:meta])* $variant:ident = $number:literal, $reaction:ident, $unit:literal, $name:literal, $remedy:literal;)*) => {
        /// Why the platform is not under control, or will not be for long. Below 100: no fault.
        ///
        /// | number | what | the daemon | what to do |
        /// | --- | --- | --- | --- |
        $(#[doc = concat!("| ", $number, " | ", $name, " | ", reaction!($reaction), " | ", $remedy, " |")])*
        #[allow(rustdoc::broken_intra_doc_links, reason = "what is in brackets is a section of the configuration")]
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

            /// Unit of the [`Evidence`]; empty if there is none.
            pub fn unit(self) -> &'static str {
                match self { $(Self::$variant => $unit,)* }
            }

            /// What the daemon does about it. No `match`: the loop calls this, and the numbers that no cause
            /// has would be traps in its machine code.
            pub fn reaction(self) -> Reaction {
                $(if self == Self::$variant {
                    return Reaction::$reaction;
                })*
                Reaction::Brake
            }
        }
    };
}

causes! {
    /// Nothing stands in the way.
    #[default]
    None = 0, None, "", "none", "nothing";
    /// No measurement has arrived yet.
    NoMeasurement = 1, None, "", "no measurement", "start the driver or the plant";
    /// No setpoint has arrived yet.
    NoSetpoint = 2, None, "", "no setpoint", "start a setpoint source, then engage";
    /// The pose is being found from the measured lengths, a bounded step per cycle.
    FindingPose = 3, None, "", "finding the pose", "wait";
    /// The setpoint is further from the platform than `control.engage_*`, or passing by.
    SetpointTooFar = 4, None, "times the engage tolerance", "setpoint too far from the platform", "start the setpoints where the platform stands";
    /// The setpoint source stopped while its setpoint was at rest.
    SetpointEnded = 5, None, "s old", "setpoint source ended at rest", "start a setpoint source, then engage";
    /// The daemon is ending.
    Stopping = 6, None, "", "daemon stopping", "nothing";
    /// Everything is ready and nobody has asked to engage.
    NotAsked = 7, None, "", "ready to engage", "engage";
    /// An operator asked for it.
    Asked = 8, None, "", "asked for", "nothing";
    /// What was asked for is not possible in this state.
    NotNow = 9, None, "", "not possible in this state", "see the table of states";
    /// The setpoint stopped arriving while it was in motion.
    SetpointLost = 100, Stop, "s old", "setpoint lost in motion", "see why its source ended";
    /// Measurements stopped arriving.
    MeasurementLost = 101, Brake, "s old", "measurement lost", "see why the driver ended";
    /// A setpoint held a number that is not finite.
    SetpointNotFinite = 102, Stop, "", "setpoint not finite", "correct the setpoint source";
    /// A measurement held a number that is not finite.
    MeasurementNotFinite = 103, Brake, "", "measurement not finite", "see the encoders and the driver";
    /// Forward kinematics did not converge on the measured lengths.
    PoseNotFound = 104, Brake, "", "pose not found from lengths", "compare the lengths with the machine file";
    /// The measured lengths moved further than the actuators can.
    MeasurementJumped = 105, Brake, "m", "measured lengths jumped", "see the encoders and the driver";
    /// The pose is singular: no forces balance the load. Or the platform may have passed one: lengths do not tell
    /// on which side of it they were measured.
    SingularPose = 106, Brake, "condition", "singular pose, or beyond one", "bring the platform back to the side of home by hand, then clear";
    /// The force was not finite.
    ForceNotFinite = 107, Brake, "", "force not finite", "report it: it is a fault of hexad";
    /// The platform was further from its reference than `control.following_*`.
    OffPath = 108, Brake, "times the following-error limit", "platform off the path", "look for a collision, a payload, a drive without force";
    /// Cycles were missed, and `realtime.on_overrun` is `fault`.
    DeadlineMissed = 109, Stop, "", "deadline missed", "see the worst cycles in the status; hexad doctor";
    /// An operator's emergency stop.
    EmergencyStop = 110, Brake, "", "emergency stop", "clear when it is safe";
    /// A setpoint beyond the stroke of a leg, or too fast to come to rest within it.
    SetpointOutOfReach = 111, Stop, "m", "setpoint beyond the stroke of a leg, or without room to stop", "correct the trajectory";
    /// A setpoint that does not continue the one before it: X, X' and X'' do not belong together.
    SetpointJumped = 112, Stop, "times what can be", "setpoint jumped", "send X, X' and X'' of one smooth motion";
    /// A measured length beyond what the leg has.
    LengthOutOfStroke = 113, Brake, "m", "measured length beyond the stroke", "see the encoders, compare with the machine file";
    /// A measured rate that is not that of the lengths.
    RateInconsistent = 114, Brake, "m apart", "measured rate does not belong to the lengths", "see the units and signs of the driver";
    /// A setpoint faster than `[limits]` or the legs allow.
    SetpointTooFast = 115, Stop, "times the limit", "setpoint beyond a limit of velocity, acceleration or jerk", "correct the trajectory, or [limits]";
    /// A setpoint outside of `[envelope]`.
    SetpointOutOfEnvelope = 116, Stop, "rad or m", "setpoint outside of the envelope", "correct the trajectory, or [envelope]";
    /// A setpoint with a time stamp from another time than now.
    SetpointFromElsewhen = 117, Stop, "s old", "setpoint with a wrong time stamp", "stamp with CLOCK_MONOTONIC";
    /// A measurement with a time stamp from another time than now.
    MeasurementFromElsewhen = 118, Brake, "s old", "measurement with a wrong time stamp", "stamp with CLOCK_MONOTONIC";
    /// The pose is so near a singular one that `limits.condition` is exceeded, or a setpoint could only be stopped
    /// where it is.
    NearSingular = 119, Stop, "condition", "near a singular pose, or without room to stop before one", "keep away from this pose; hexad check";
    /// The measured rates changed faster than actuators can.
    RateJumped = 120, Brake, "m/s", "measured rates jumped", "look for a collision; see the encoders and the driver";
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

/// The number that caused it, and what it should have been.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    pub value: f64,
    pub bound: f64,
    /// Leg or axis, from 1; 0 where it is neither.
    pub index: u32,
}

/// A cause with its evidence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trouble {
    pub cause: Cause,
    pub evidence: Evidence,
}

impl Trouble {
    /// With the number and its bound.
    pub fn new(cause: Cause, value: f64, bound: f64) -> Self {
        Self { cause, evidence: Evidence { value, bound, index: 0 } }
    }

    /// Of a leg or an axis, counted from 0.
    pub fn at(self, index: usize) -> Self {
        Self { evidence: Evidence { index: index as u32 + 1, ..self.evidence }, ..self }
    }
}

impl From<Cause> for Trouble {
    fn from(cause: Cause) -> Self {
        Self { cause, ..Self::default() }
    }
}
