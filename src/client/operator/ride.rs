//! A ride: a source of setpoints carries persons, and the operator begins and ends it.
//!
//! The source says its phase with each `status`; the answer has the order of the operator for it. So an order needs the rights of any
//! request and the present number of stops, it is valid only while who gave it waits for it, and no stream can give one.

use serde::{Deserialize, Serialize};

hexad_core::named! {
    /// What a source with a ride does.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum RidePhase {
        /// The platform moves to the boarding pose.
        Boarding => "boarding",
        /// It stands there.
        Ready => "ready",
        /// It stands there, and the stream may be of other units than its format.
        Doubtful => "doubtful",
        /// It follows the stream.
        Riding => "riding",
        /// It stands, as the stream paused.
        Paused => "paused",
        /// It stands, as the operator paused it.
        PausedByOperator => "paused_by_operator",
    }
}

hexad_core::named! {
    /// What the operator wants.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum RideOrder {
        /// The platform follows the stream.
        Start => "ride_start",
        /// The platform moves to the boarding pose.
        End => "ride_end",
    }
}

/// What a phase means for an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RideVerdict {
    /// It is reached; for a new order the reason why there is nothing to do.
    Reached(&'static str),
    /// It is on the way.
    Pending,
    /// It cannot be carried out.
    Refused(&'static str),
}

impl RideOrder {
    /// What a phase means for this order. `is_confirmed`: the operator takes a doubtful stream as it is.
    pub fn verdict(self, phase: RidePhase, is_confirmed: bool) -> RideVerdict {
        use RideVerdict::{Pending, Reached, Refused};
        match (self, phase) {
            (Self::Start, RidePhase::Riding) => Reached("the ride has begun already"),
            (Self::Start, RidePhase::Ready) | (Self::End, RidePhase::Riding | RidePhase::Paused) => Pending,
            (Self::Start, RidePhase::Doubtful) if is_confirmed => Pending,
            (Self::Start, RidePhase::Doubtful) => Refused(
                "the stream looks as if it had other units than its format; hexad ride start --yes begins anyway",
            ),
            (Self::Start, RidePhase::Boarding) => Refused("the platform is on its way to the boarding pose"),
            (Self::Start, RidePhase::Paused) => Refused("the ride goes on with its stream, which pauses"),
            (_, RidePhase::PausedByOperator) => Refused("the source is paused; hexad move --resume goes on"),
            (Self::End, _) => Reached("no ride is in progress"),
        }
    }
}
