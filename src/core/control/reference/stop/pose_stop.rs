//! Stop of position and orientation together.
//!
//! In base axes `v' = a` and `w' = al`, so that the stop of a vector serves both. Only the attitude is not
//! linear: `R <- exp(W) R` with `W = theta - dt^2/12 w0 x w1`, theta the integral of w (Magnus; the remainder
//! is of order dt^5).

use fearless_simd::{Level, Simd, dispatch};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::control::reference::stop::vector_stop::{Stop, VectorStopState};
use crate::control::signals::limits::{DerivativeLimits, Limits};
use crate::control::signals::pair::Pair;
use crate::model::rigid::{Motion, Pose, Twist};

/// Kind of a stop, see [`super::vector_stop`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::control::reference) enum StopKind {
    /// Releases the acceleration, then brakes.
    #[default]
    ReleaseFirst,
    /// Brakes at once.
    BrakeAtOnce,
}

/// Stop of orientation and position.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::reference) struct PoseStop {
    pub orientation: Stop,
    pub position: Stop,
}

/// State of a stop at one instant, relative to its start.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::reference) struct PoseStopState {
    pub orientation: VectorStopState,
    pub position: VectorStopState,
}

impl PoseStopState {
    /// State at the start of a stop from a motion.
    pub fn begin(Motion { twist, acceleration, .. }: &Motion) -> Self {
        let state = |velocity: &Vector3<f64>, acceleration: &Vector3<f64>| VectorStopState {
            displacement: Vector3::zeros(),
            velocity: *velocity,
            acceleration: *acceleration,
        };
        Self {
            orientation: state(&twist.angular, &acceleration.angular),
            position: state(&twist.linear, &acceleration.linear),
        }
    }
}

impl PoseStop {
    /// Stop of a kind from a motion.
    #[cfg(test)]
    pub fn new(kind: StopKind, motion: &Motion, limits: &Limits) -> Self {
        let mut stop = Self::default();
        stop.plan(Level::new(), kind, motion, limits);
        stop
    }

    /// Plans the stop of a kind from a motion, in place.
    #[inline(never)]
    pub fn plan(&mut self, level: Level, kind: StopKind, motion: &Motion, limits: &Limits) {
        dispatch!(level, simd => self.plan_in_lanes(simd, kind, motion, limits));
    }

    #[inline(always)]
    fn plan_in_lanes<S: Simd>(&mut self, simd: S, kind: StopKind, motion: &Motion, limits: &Limits) {
        let Motion { twist, acceleration, .. } = motion;
        let orientation = (&mut self.orientation, &twist.angular, &acceleration.angular, &limits.orientation);
        let position = (&mut self.position, &twist.linear, &acceleration.linear, &limits.position);
        // One piece of code for both vectors: the code of the cycle stays short.
        for (stop, v, a, limits) in [orientation, position] {
            match kind {
                StopKind::ReleaseFirst => stop.release_first(simd, v, a, limits),
                StopKind::BrakeAtOnce => stop.brake_at_once(simd, v, a, limits),
            }
        }
    }

    /// State `t_s` seconds after the start.
    pub fn state_at(&self, level: Level, t_s: f64) -> PoseStopState {
        dispatch!(level, simd => self.at(simd, t_s))
    }

    /// Time to rest \[s\].
    pub fn duration(&self) -> f64 {
        self.orientation.duration_s.max(self.position.duration_s)
    }

    /// State `t_s` seconds after the start, in SIMD lanes.
    #[inline(always)]
    pub fn at<S: Simd>(&self, simd: S, t_s: f64) -> PoseStopState {
        PoseStopState { orientation: self.orientation.at(simd, t_s), position: self.position.at(simd, t_s) }
    }

    /// Bounds on the distance that the stop covers within half of `dt_s` before or after a state: around a
    /// knot, with knots `dt_s` apart.
    #[inline(always)]
    pub fn reach(&self, state: &PoseStopState, dt_s: f64, limits: &Limits) -> Pair<f64> {
        let half = 0.5 * dt_s;
        let way = |stop: &Stop, state: &VectorStopState, limits: &DerivativeLimits| {
            half * stop.peak_velocity.min(state.velocity.norm() + 0.5 * half * limits.acceleration)
        };
        Pair {
            angular: way(&self.orientation, &state.orientation, &limits.orientation),
            linear: way(&self.position, &state.position, &limits.position),
        }
    }
}

/// Pose after the section of a stop between two states, `dt_s` seconds apart.
pub(in crate::control::reference) fn advanced(
    pose: &Pose,
    from: &PoseStopState,
    to: &PoseStopState,
    dt_s: f64,
) -> Pose {
    pose.displaced(&displacement(from, to, dt_s))
}

/// The same pose without orthonormalizing the rotation, for the few knots of an examination.
#[inline(always)]
pub(in crate::control::reference) fn advanced_without_orthonormalizing(
    pose: &Pose,
    from: &PoseStopState,
    to: &PoseStopState,
    dt_s: f64,
) -> Pose {
    pose.extrapolated(&displacement(from, to, dt_s))
}

#[inline(always)]
fn displacement(from: &PoseStopState, to: &PoseStopState, dt: f64) -> Twist {
    let turn = to.orientation.displacement - from.orientation.displacement;
    let commutator = from.orientation.velocity.cross(&to.orientation.velocity) * (dt * dt / 12.0);
    Twist { angular: turn - commutator, linear: to.position.displacement - from.position.displacement }
}
