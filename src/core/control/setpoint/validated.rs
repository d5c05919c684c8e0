//! The last valid setpoint, and the target that follows from it in a state.

use crate::control::constants::Constants;
use crate::control::setpoint::motion::SetpointMotion;
use crate::control::setpoint::target::Target;
use crate::control::signals::diagnostic::Diagnostic;
use crate::control::signals::limits::LimitSet;
use crate::control::signals::state::State;

/// The last valid setpoint, whether it may be followed, and the limits that it is near.
pub(in crate::control) struct ValidatedSetpoint<'a> {
    pub valid: Option<&'a SetpointMotion>,
    /// Target of the reference that the setpoint requests.
    pub target: Option<Target<'a>>,
    /// Whether the valid setpoint may be followed: recent enough, and after a loss near enough.
    pub follow_check: Result<(), Diagnostic>,
    /// Limits that the newest setpoint is near; none with policy `limit`, where the reference has its own.
    pub active_limits: LimitSet,
    /// Whether the valid setpoint keeps the limits, as "stop" demands.
    pub keeps_limits: bool,
}

impl<'a> ValidatedSetpoint<'a> {
    /// Target of the reference in a state; `None` if the reference follows its stop.
    #[inline(never)]
    pub fn target_in(&self, constants: &'a Constants, state: State) -> Option<Target<'a>> {
        match state {
            State::Engaging | State::Active => self.target.filter(|_| self.follow_check.is_ok()),
            State::Parking => Some(Target::Pose { pose: constants.home.pose(), speed_share: 1.0 }),
            State::Off | State::Standby | State::Stopping | State::Fault => None,
        }
    }
}
