//! The stop that is held ready: verified in an earlier step, it may be followed from the present motion on.

use crate::control::constants::Constants;
use crate::control::reference::stop::pose_stop::{PoseStop, PoseStopState, StopKind, advanced};
use crate::control::setpoint::target::at_rest;
use crate::model::rigid::{Acceleration, Motion, Twist};

/// Where the stop begins.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::control::reference) enum Phase {
    /// The platform does not move.
    #[default]
    AtRest,
    /// At the present motion.
    Verified(StopKind),
    /// Before it: the stop is followed.
    Followed,
}

/// The stop that may be followed from the present motion on.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::control::reference) struct HeldStop {
    pub(in crate::control::reference) phase: Phase,
    /// One is held, if it is brake_at_once or followed: the other kind is planned once it is needed. In the place of the other one the next is
    /// planned: to copy a stop would take a third of the time of planning it.
    stops: [PoseStop; 2],
    is_second_held: bool,
    state: PoseStopState,
    pub(in crate::control::reference) elapsed_s: f64,
}

impl HeldStop {
    /// The place for a brake_at_once stop that may become the held one.
    pub fn spare(&mut self) -> &mut PoseStop {
        let [first, second] = &mut self.stops;
        if self.is_second_held { first } else { second }
    }

    /// Holds the stop of a kind, verified from the present motion on; a brake_at_once one as it was planned in the place of the next.
    pub fn adopt(&mut self, kind: StopKind) {
        self.is_second_held ^= kind == StopKind::BrakeAtOnce;
        self.phase = Phase::Verified(kind);
    }

    fn held(&self) -> &PoseStop {
        let [first, second] = &self.stops;
        if self.is_second_held { second } else { first }
    }

    /// Whether the platform is at rest at its end.
    pub fn is_at_rest(&self) -> bool {
        match self.phase {
            Phase::AtRest => true,
            Phase::Verified(_) => false,
            Phase::Followed => self.elapsed_s >= self.held().duration(),
        }
    }

    /// The motion a step later along the stop, which is followed from now on.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    pub fn follow(&mut self, constants: &Constants, motion: &Motion, h: f64) -> Motion {
        match self.phase {
            Phase::AtRest => self.begin(constants, StopKind::ReleaseFirst, &at_rest(&motion.pose)),
            Phase::Verified(kind) => self.begin(constants, kind, motion),
            Phase::Followed => {}
        }
        self.elapsed_s += h;
        let next = self.held().state_at(constants.machine().level, self.elapsed_s);
        let pose = advanced(&motion.pose, &self.state, &next, h);
        self.state = next;
        let PoseStopState { orientation, position } = next;
        Motion {
            pose,
            twist: Twist { angular: orientation.velocity, linear: position.velocity },
            acceleration: Acceleration { angular: orientation.acceleration, linear: position.acceleration },
        }
    }

    fn begin(&mut self, constants: &Constants, kind: StopKind, motion: &Motion) {
        if let StopKind::ReleaseFirst = kind {
            self.spare().plan(constants.machine().level, kind, motion, &constants.parameters.limits);
            self.is_second_held ^= true;
        }
        (self.phase, self.state, self.elapsed_s) = (Phase::Followed, PoseStopState::begin(motion), 0.0);
    }
}
