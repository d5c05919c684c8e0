//! Errors of the source of targets.

use core::fmt;

use nalgebra::Vector3;

use hexad_client::messages::PortError;
use hexad_client::operator::OperatorError;
use hexad_client::operator::protocol::RequestResult;
use hexad_core::control::signals::state::State;
use hexad_core::control::supervision::in_position::InPositionWindow;
use hexad_core::model::rigid::Twist;
use hexad_machine::analysis::target_motion::TargetRefusal;
use hexad_machine::text::numbers::significant;

/// Reason why a target is not published, or not followed.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    /// The shared memory cannot be used.
    #[error(transparent)]
    Port(#[from] PortError),
    /// Control was not taken.
    #[error(transparent)]
    Operator(#[from] OperatorError),
    /// The target or the way to it is outside of the workspace.
    #[error(transparent)]
    Refused(#[from] TargetRefusal),
    /// The same, with the target in the coordinates of the request.
    #[error("{0}\n{1}")]
    RefusedInFrames(TargetRefusal, String),
    /// The straight way of a tool is too fast for the daemon, even within this time \[s\].
    #[error(
        "the daemon would not follow the straight way of the tool, even within {0:.1} s: at {1}; go by another pose, or without a tool"
    )]
    NotFollowable(f64, String),
    /// The straight way of a tool has no setpoints.
    #[error(
        "beta of the platform passes 90 deg on the way, where the angles have no rates; go by another pose, or without a tool"
    )]
    AngleRates,
    /// Times are simulated.
    #[error("the machine runs in simulated time, in which no person moves it; use hexad move")]
    Simulated,
    /// Another process is the source.
    #[error("{0} publishes setpoints; end it first (hexad stop, or Ctrl-C there)")]
    OtherSource(String),
    /// The platform does not stand under control.
    #[error("the platform is not under control (state {state}: {1}); engage takes control", state = .0.name())]
    NotInControl(State, String),
    /// No pose is measured.
    #[error("the pose of the platform is unknown: {0}")]
    UnknownPose(String),
    /// The daemon has another setpoint.
    #[error("the daemon does not follow this target, but another setpoint: does another source run?")]
    NotFollowed,
    /// An operator or a fault has ended control.
    #[error("control has ended: the daemon is in {state}: {1}", state = .0.name())]
    Ended(State, String),
    /// The daemon does not answer.
    #[error("control has ended: {0}")]
    NoAnswer(String),
    /// The reference has not reached the target within this time \[s\].
    #[error("the target was not reached within {0:.1} s")]
    TimedOut(f64),
    /// The platform was not in position within this time \[s\].
    #[error(
        "the reference has reached the target, but the platform was not in position within {0:.1} s: it is {1} from the target, \
         tolerance {tolerance} (in_position.tolerance_m, tolerance_rad, or tolerance_m of the request); look for friction, noise that is \
         not stated, and a force that holds the platform; it stands under control",
        tolerance = Deviation::of_window(.2)
    )]
    NotInPosition(f64, Deviation, InPositionWindow),
}

impl TargetError {
    /// Result of a request that this error ends. A request for a way that the platform cannot go is not valid.
    pub fn result(&self) -> RequestResult {
        match self {
            Self::Refused(_) | Self::RefusedInFrames(..) | Self::NotFollowable(..) | Self::AngleRates => {
                RequestResult::Invalid
            }
            Self::Simulated | Self::OtherSource(_) | Self::NotInControl(..) | Self::UnknownPose(_) => {
                RequestResult::Refused
            }
            Self::TimedOut(_) | Self::NotInPosition(..) => RequestResult::TimedOut,
            Self::Port(_) | Self::Operator(_) | Self::NotFollowed | Self::Ended(..) | Self::NoAnswer(_) => {
                RequestResult::Failed
            }
        }
    }
}

/// Reason of a refusal: what the daemon says of its state, and never an empty text.
pub fn reason(text: &str) -> String {
    let without_fault = "the daemon reports no fault: is the driver, or in simulated time a source, started?";
    if matches!(text, "" | "none") { without_fault } else { text }.into()
}

/// Distance and angle, for people.
#[derive(Debug)]
pub struct Deviation(pub Twist);

impl Deviation {
    fn of_window(window: &InPositionWindow) -> Self {
        let [linear, angular] =
            [window.tolerance_m, window.tolerance_rad].map(|length| Vector3::x() * length);
        Self(Twist { angular, linear })
    }
}

impl fmt::Display for Deviation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // To nanometres and nanoradians.
        let [mm, mrad] =
            [self.0.linear, self.0.angular].map(|error| significant(1e-6 * (1e9 * error.norm()).round()));
        write!(f, "{mm} mm and {mrad} mrad")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_always_has_a_reason() {
        for text in ["", "none", "no measurement"] {
            let refusal = TargetError::UnknownPose(reason(text)).to_string();
            assert!(refusal.ends_with("started?") || refusal.ends_with(": no measurement"), "{refusal}");
        }
    }
}
