//! The stop that is held ready: verified in an earlier step, it may be followed from the present motion on.

use super::pose_stop::{PoseStop, PoseStopState, StopKind, advanced};
use super::target::at_rest;
use crate::control::limits::Limits;
use crate::model::rigid::{Acceleration, Motion, Twist};

/// Where the stop begins.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum Phase {
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
pub(super) struct HeldStop {
    pub(super) phase: Phase,
    /// Of a planar stop, or while it is followed: the other is planned once it is needed.
    pub(super) stop: PoseStop,
    state: PoseStopState,
    pub(super) elapsed_s: f64,
}

impl HeldStop {
    /// Holds the stop of a kind, verified from the present motion on; a planar one as it was planned.
    pub fn hold(&mut self, kind: StopKind, planar: &PoseStop) {
        if let StopKind::Planar = kind {
            self.stop = *planar;
        }
        self.phase = Phase::Verified(kind);
    }

    /// Whether the platform is at rest at its end.
    pub fn is_at_rest(&self) -> bool {
        match self.phase {
            Phase::AtRest => true,
            Phase::Verified(_) => false,
            Phase::Followed => self.elapsed_s >= self.stop.duration(),
        }
    }

    /// The motion a step later along the stop, which is followed from now on.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    pub fn follow(&mut self, motion: &Motion, limits: &Limits, h: f64) -> Motion {
        match self.phase {
            Phase::AtRest => self.begin(StopKind::ReleaseFirst, &at_rest(&motion.pose), limits),
            Phase::Verified(kind) => self.begin(kind, motion, limits),
            Phase::Followed => {}
        }
        self.elapsed_s += h;
        let next = self.stop.at(self.elapsed_s);
        let pose = advanced(&motion.pose, &self.state, &next, h);
        self.state = next;
        let PoseStopState { orientation, position } = next;
        Motion {
            pose,
            twist: Twist { angular: orientation.velocity, linear: position.velocity },
            acceleration: Acceleration { angular: orientation.acceleration, linear: position.acceleration },
        }
    }

    fn begin(&mut self, kind: StopKind, motion: &Motion, limits: &Limits) {
        if let StopKind::ReleaseFirst = kind {
            self.stop.plan(kind, motion, limits);
        }
        (self.phase, self.state, self.elapsed_s) = (Phase::Followed, self.stop.at(0.0), 0.0);
    }
}
