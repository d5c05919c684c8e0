//! Errors of the source of targets.

use core::fmt;

use nalgebra::Vector3;

use crate::analysis::target_motion::TargetRefusal;
use crate::commands::failure::{CommandError, INTERRUPTED, default_exit_code};
use crate::control::supervision::in_position::InPositionWindow;
use crate::messages::PortError;
use crate::model::rigid::Twist;
use crate::operator::OperatorError;
use crate::output::numbers::significant;

/// Reason why a target is not published, or not followed.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error(transparent)]
    Operator(#[from] OperatorError),
    #[error(transparent)]
    Refused(#[from] TargetRefusal),
    #[error("{0}\n{1}")]
    RefusedInFrames(TargetRefusal, String),
    #[error(
        "the daemon would not follow the straight way of the tool, even within {0:.1} s: at {1}; go by another pose, or without --tool"
    )]
    NotFollowable(f64, String),
    #[error(
        "beta of the platform passes 90 deg on the way, where the angles have no rates; go by another pose, or without --tool"
    )]
    AngleRates,
    #[error("the machine runs in simulated time, in which no person moves it; use hexad move")]
    Simulated,
    #[error("{0} publishes setpoints; end it first (hexad stop, or Ctrl-C there)")]
    OtherSource(String),
    #[error("the platform is not under control (state {0}: {1}); --engage takes control")]
    NotInControl(String, String),
    #[error("the pose of the platform is unknown: {0}")]
    UnknownPose(String),
    #[error("the daemon does not follow this target, but another setpoint: does another source run?")]
    NotFollowed,
    #[error("control has ended: the daemon is in {0}: {1}")]
    Ended(String, String),
    #[error("the target was not reached within {0:.1} s")]
    TimedOut(f64),
    #[error(
        "the reference has reached the target, but the platform was not in position within {0:.1} s: it is {1} from the target, \
         tolerance {tolerance} (in_position.tolerance_m, tolerance_rad, or --tolerance); look for friction, noise that is not \
         stated, and a force that holds the platform; it stands under control",
        tolerance = Deviation::of_window(.2)
    )]
    NotInPosition(f64, Deviation, InPositionWindow),
    #[error("interrupted; the platform stands under control; hexad stop or park ends it")]
    Interrupted,
    #[error("interrupted before control was taken; hexad status shows the state")]
    InterruptedEarly,
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

impl CommandError for TargetError {
    fn has_begun(&self) -> bool {
        match self {
            Self::Port(_) | Self::Refused(_) | Self::RefusedInFrames(..) | Self::Simulated => false,
            Self::NotFollowable(..) | Self::AngleRates => false,
            Self::Operator(error) => error.has_begun(),
            _ => true,
        }
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted | Self::InterruptedEarly => INTERRUPTED,
            _ => default_exit_code(self),
        }
    }
}
