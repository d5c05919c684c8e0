//! States of the controller and operator requests, with their numbers in the messages.
//!
//! | state | force | ends with |
//! | --- | --- | --- |
//! | off | not valid: brake | the pose is known: standby; after request `off`: `clear`, `engage` or `park` |
//! | standby | not valid: brake | `engage`: engaging; `park`: stopping, then parking; the pose is lost: off |
//! | engaging | controlled, from the measured motion onto the setpoint | on the setpoint, or 1 s after it was near: active; as active |
//! | active | controlled, on the setpoint | `stop`, `park`, setpoint ended, lost or rejected: stopping |
//! | stopping | controlled, to rest along a verified stop | at rest: standby, parking or fault |
//! | parking | controlled, to the home pose | at home: off; `stop`, a fault that stops: stopping |
//! | fault | not valid: brake | `clear`: off, and on to standby |
//!
//! In every state `estop` leads to fault, and in every state but fault `off` leads to off, within the cycle.
//! Only `clear` ends a fault. Without control there is no gravity support: the driver closes the brakes when
//! it receives no valid force.
//!
//! The platform may still move when control begins, by `engage` or `park`. Both requests are refused if no
//! stop within every limit exists for its motion. Under `[setpoint] on_violation = "limit"` a platform
//! without setpoints comes to rest and holds its pose in the state engaging, which is no fault. When
//! setpoints arrive again, it moves onto them; with `setpoint.on_return = "hold"` only if they are near, or after `engage`. With
//! `control.on_setpoint_lost = "park"` or `"stop"` it parks or stops after `control.lost_hold_s`.

use serde::{Deserialize, Serialize};

crate::named! {
    /// State of the controller, which decides whether forces are valid and which reference the platform follows.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
    #[repr(u32)]
    pub enum State {
        /// No force: the pose is unknown, or an operator requested it.
        #[default]
        Off = 0 => "off",
        /// No force; ready to engage.
        Standby = 1 => "standby",
        /// Moves from the measured motion onto the setpoint, or holds its pose until setpoints arrive.
        Engaging = 2 => "engaging",
        /// Follows the setpoint.
        Active = 3 => "active",
        /// Decelerates to rest along a verified stop.
        Stopping = 4 => "stopping",
        /// Moves to the home pose.
        Parking = 5 => "parking",
        /// No force until cleared.
        Fault = 6 => "fault",
    }
}

impl State {
    /// Whether the platform is under control: forces are valid in these states and in no other.
    pub fn has_control(self) -> bool {
        matches!(self, Self::Engaging | Self::Active | Self::Stopping | Self::Parking)
    }

    /// Whether the platform follows the setpoint, or moves to it.
    pub fn follows(self) -> bool {
        matches!(self, Self::Engaging | Self::Active)
    }

    /// Reads the number of a message.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|state| *state as u32 == number)
    }
}

crate::named! {
    /// Operator request, one per message. Of several requests within one cycle the last in this order takes
    /// effect.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
    #[repr(u32)]
    pub enum Request {
        /// Take control and follow the setpoint.
        Engage = 1 => "engage",
        /// Leave the fault.
        Clear = 2 => "clear",
        /// Come to rest, go home, disable the forces.
        Park = 3 => "park",
        /// Come to rest, disable the forces.
        Stop = 4 => "stop",
        /// Disable the forces at once; brakes close.
        Off = 5 => "off",
        /// Disable the forces at once, until cleared.
        Estop = 6 => "estop",
    }
}

impl Request {
    /// Whether the request may begin control of the platform.
    pub fn can_begin_control(self) -> bool {
        matches!(self, Self::Engage | Self::Park)
    }

    /// Reads the number of a message.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|request| *request as u32 == number)
    }
}

/// Identity of a message, unique within its topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MessageId {
    /// Start of the publisher, or of the request words of a daemon.
    pub epoch: u64,
    /// Number of the message within the epoch.
    pub sequence: u64,
}

/// An operator's request with the identity of its message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OperatorRequest {
    /// Change of state that the operator requests.
    pub request: Request,
    /// Identity of the message.
    pub message: MessageId,
}

/// Goal of a stop: the state that follows once the platform is at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum AfterStop {
    /// Forces are disabled; brakes close.
    #[default]
    Standby,
    /// Moves to the home pose.
    Park,
    /// Forces are disabled until cleared.
    Fault,
}
