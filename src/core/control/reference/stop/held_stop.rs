//! The stop that is held ready. An earlier step verified it; the reference may follow it from the present
//! motion on.

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::reference::stop::pose_stop::{PoseStop, PoseStopState, StopKind, advanced};
use crate::control::setpoint::target::at_rest;
use crate::model::rigid::{Acceleration, Motion, Twist};

/// Start of the stop.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::reference) enum Phase {
    /// The platform does not move: no stop is planned.
    #[default]
    AtRest,
    /// The stop begins at the present motion.
    Verified(StopKind),
    /// The stop began earlier: it is followed.
    Followed,
}

/// Stop that may be followed from the present motion on.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::reference) struct HeldStop {
    pub(in crate::control::reference) phase: Phase,
    /// Two slots. One holds the current stop if it brakes at once or is followed. The next candidate is
    /// planned in the other slot, because copying a stop would take a third of the time of planning it. A
    /// release-first stop is planned only when it is followed.
    stops: [PoseStop; 2],
    is_second_held: bool,
    /// Share of the accelerations with which the stop is planned.
    strength: f64,
    state: PoseStopState,
    pub(in crate::control::reference) elapsed_s: f64,
}

impl HeldStop {
    /// Slot for planning a stop that brakes at once; it may become the held stop.
    pub fn spare(&mut self) -> &mut PoseStop {
        let [first, second] = &mut self.stops;
        if self.is_second_held { first } else { second }
    }

    /// Holds a stop of this kind, verified from the present motion on. A stop that brakes at once was planned
    /// in the spare slot.
    pub fn adopt(&mut self, kind: StopKind, strength_share: f64) {
        self.is_second_held ^= kind == StopKind::BrakeAtOnce;
        self.strength = strength_share;
        self.phase = Phase::Verified(kind);
    }

    fn held(&self) -> &PoseStop {
        let [first, second] = &self.stops;
        if self.is_second_held { second } else { first }
    }

    /// Whether the platform is at rest: no stop is needed, or the followed stop has ended.
    pub fn is_at_rest(&self) -> bool {
        match self.phase {
            Phase::AtRest => true,
            Phase::Verified(_) => false,
            Phase::Followed => self.elapsed_s >= self.held().duration(),
        }
    }

    /// Motion after a step of `dt_s` seconds along the stop, which is followed from now on.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    pub fn follow(&mut self, constants: &Constants, motion: &Motion, dt_s: f64) -> Motion {
        match self.phase {
            Phase::AtRest => self.begin(constants, StopKind::ReleaseFirst, &at_rest(&motion.pose)),
            Phase::Verified(kind) => self.begin(constants, kind, motion),
            Phase::Followed => {}
        }
        self.elapsed_s += dt_s;
        let next = self.held().state_at(constants.machine().level, self.elapsed_s);
        let pose = advanced(&motion.pose, &self.state, &next, dt_s);
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
            let limits = constants.parameters.limits.scaled_at_equal_stopping_distance(self.strength);
            self.spare().plan(constants.machine().level, kind, motion, &limits);
            self.is_second_held ^= true;
        }
        (self.phase, self.state, self.elapsed_s) = (Phase::Followed, PoseStopState::begin(motion), 0.0);
    }
}
