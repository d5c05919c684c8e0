//! Stop of position and orientation at once.
//!
//! In base axes `v' = a` and `w' = al`: one stop of a vector serves both. Only attitude is not linear,
//! `R <- exp(W) R` with `W = theta - dt^2/12 w0 x w1`, theta the integral of w (Magnus; the remainder is of order dt^5).

use nalgebra::Vector3;

use super::regularity::Reach;
use super::stop::{Stop, StopState};
use crate::control::limits::{DerivativeLimits, Limits};
use crate::model::rigid::{Motion, Pose, Twist};

/// Stop that was verified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum StopKind {
    /// See [`super::stop`].
    #[default]
    ReleaseFirst,
    /// See [`super::stop`].
    Planar,
}

/// Stop of orientation and position.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct PoseStop {
    pub orientation: Stop,
    pub position: Stop,
}

/// Motion parameters of a stop at one instant, relative to its start.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct PoseStopState {
    pub orientation: StopState,
    pub position: StopState,
}

impl PoseStop {
    /// The stop of a kind from a motion.
    #[cfg(test)]
    pub fn new(kind: StopKind, motion: &Motion, limits: &Limits) -> Self {
        let mut stop = Self::default();
        stop.plan(kind, motion, limits);
        stop
    }

    /// Becomes the stop of a kind from a motion.
    pub fn plan(&mut self, kind: StopKind, motion: &Motion, limits: &Limits) {
        let Motion { twist, acceleration, .. } = motion;
        // No pointer to a function: the proof on the machine code does not follow calls through pointers.
        let plan = |stop: &mut Stop, v: &Vector3<f64>, a: &Vector3<f64>, limits: &DerivativeLimits| match kind
        {
            StopKind::ReleaseFirst => stop.release_first(v, a, limits),
            StopKind::Planar => stop.planar(v, a, limits),
        };
        plan(&mut self.orientation, &twist.angular, &acceleration.angular, &limits.orientation);
        plan(&mut self.position, &twist.linear, &acceleration.linear, &limits.position);
    }

    /// Time to rest \[s\].
    pub fn duration(&self) -> f64 {
        self.orientation.duration.max(self.position.duration)
    }

    /// State `t` seconds after the start.
    #[inline(always)]
    pub fn at(&self, t: f64) -> PoseStopState {
        PoseStopState { orientation: self.orientation.at(t), position: self.position.at(t) }
    }

    /// Bounds on how far the stop moves within half of `dt` after a state, or before it: around one of the knots `dt` apart.
    #[inline(always)]
    pub fn reach(&self, state: &PoseStopState, dt: f64, limits: &Limits) -> Reach {
        let half = 0.5 * dt;
        let way = |stop: &Stop, state: &StopState, limits: &DerivativeLimits| {
            half * stop.peak_velocity.min(state.velocity.norm() + 0.5 * half * limits.acceleration)
        };
        [
            way(&self.position, &state.position, &limits.position),
            way(&self.orientation, &state.orientation, &limits.orientation),
        ]
    }
}

/// Pose after the part of a stop from one state to the next, `dt` seconds later.
pub(super) fn advanced(pose: &Pose, from: &PoseStopState, to: &PoseStopState, dt: f64) -> Pose {
    pose.displaced(&displacement(from, to, dt))
}

/// The same without bringing the rotation back to an orthonormal matrix: for the few knots of an examination.
#[inline(always)]
pub(super) fn advanced_to_knot(pose: &Pose, from: &PoseStopState, to: &PoseStopState, dt: f64) -> Pose {
    pose.extrapolated(&displacement(from, to, dt))
}

#[inline(always)]
fn displacement(from: &PoseStopState, to: &PoseStopState, dt: f64) -> Twist {
    let turn = to.orientation.displacement - from.orientation.displacement;
    let commutator = from.orientation.velocity.cross(&to.orientation.velocity) * (dt * dt / 12.0);
    Twist { angular: turn - commutator, linear: to.position.displacement - from.position.displacement }
}
