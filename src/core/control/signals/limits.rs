//! Limits of a reference, and the set of limits that a cycle has reached.
//!
//! | bit | limit | bound | at the bound |
//! | --- | --- | --- | --- |
//! | 0 | force | `actuator.max_force_n` | the reference is slower, and stops before it; beyond it the gravity part stays, one factor reduces the rest |
//! | 1 | force rate | `limits.force_rate_n_s` | one factor reduces the changes of all forces |
//! | 2 | stroke | `actuator.*_length_m` less `limits.stroke_margin_m` | the reference stops before it |
//! | 3 | leg rate | `actuator.max_rate_m_s` | kept by the reference |
//! | 4 | envelope | `[envelope]` | the reference stops before it |
//! | 5 | velocity | `limits.velocity_*` times `limits.scale` | kept by the reference |
//! | 6 | acceleration | `limits.acceleration_*` times `limits.scale` | kept by the reference |
//! | 7 | jerk | `limits.jerk_*` times `limits.scale` | kept by the reference |
//! | 8 | following error | `control.following_*`, of pose and velocity | fault |
//! | 9 | condition | `limits.condition` | the reference stops before it; platform beyond it: stop, fault |
//!
//! The reference keeps its limits for every setpoint. Under `on_violation = "stop"` a setpoint beyond a limit
//! is rejected, unless the limit is jerk, condition or force. A setpoint that the reference falls behind by more
//! than the engage tolerance is rejected, too. A rejected setpoint counts as not received: the reference
//! continues over one wrong message among valid ones, and a stream of wrong messages ends in a stop. Under
//! "limit" the reference follows as near as the limits allow.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use serde::{Deserialize, Serialize};

use crate::model::rigid::Acceleration;

crate::named! {
    /// Limit by the number of its bit in a [`LimitSet`].
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[repr(u32)]
    pub enum Limit {
        /// Actuator force, `actuator.max_force_n` \[N\].
        Force = 0 => "force",
        /// Change of an actuator's force, `limits.force_rate_n_s` \[N/s\].
        ForceRate = 1 => "force rate",
        /// Leg length, `actuator.min_length_m` to `actuator.max_length_m` \[m\].
        Stroke = 2 => "stroke",
        /// Rate of a leg's length, `actuator.max_rate_m_s` \[m/s\].
        LegRate = 3 => "leg rate",
        /// Range of X, `[envelope]` \[rad\], \[m\].
        Envelope = 4 => "envelope",
        /// Velocity of the platform, `limits.velocity_*` times `limits.scale` \[rad/s\], \[m/s\].
        Velocity = 5 => "velocity",
        /// Acceleration of the platform, `limits.acceleration_*` times `limits.scale` \[rad/s^2\], \[m/s^2\].
        Acceleration = 6 => "acceleration",
        /// Jerk of the platform, `limits.jerk_*` times `limits.scale` \[rad/s^3\], \[m/s^3\].
        Jerk = 7 => "jerk",
        /// Following error under control, `control.following_*` \[rad\], \[m\].
        Following = 8 => "following error",
        /// Condition of the pose, `limits.condition`; without unit.
        Condition = 9 => "condition",
        /// Compensated disturbance, half of `limits.acceleration_*` without the scale \[rad/s^2\], \[m/s^2\]. What is beyond it, as of a payload or a
        /// direction of gravity that the file lacks, remains as a following error.
        Compensation = 10 => "disturbance compensation",
    }
}

/// Set of limits that a cycle has reached, or nearly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LimitSet(pub u32);

/// Largest of several ratios of a quantity to its bound. NaN if any ratio is NaN; `f64::max` would hide it
/// and a check would pass.
pub fn largest_ratio_or_nan<const N: usize>(ratios: [f64; N]) -> f64 {
    let larger =
        |largest: f64, ratio: f64| if largest.is_nan() || ratio <= largest { largest } else { ratio };
    ratios.into_iter().fold(0.0, larger)
}

/// Share of a bound above which its limit is in the set: the operator is warned before the bound is exceeded.
const WARNING_RATIO: f64 = 0.9;

impl LimitSet {
    /// The set with a limit added if it is active.
    pub fn with(self, limit: Limit, is_active: bool) -> Self {
        Self(self.0 | u32::from(is_active) << limit as u32)
    }

    /// Adds a limit if `ratio`, a quantity over its bound, is nearly 1 or more. True if the bound is kept;
    /// NaN exceeds it.
    pub fn check(&mut self, limit: Limit, ratio: f64) -> bool {
        *self = self.with(limit, ratio > WARNING_RATIO);
        ratio <= 1.0
    }

    /// The limits of both sets.
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether no limit is in the set.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether a limit is in the set.
    pub fn contains(self, limit: Limit) -> bool {
        self.0 & 1 << limit as u32 != 0
    }
}

/// Largest velocity, acceleration and jerk of a reference, for position and orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Limits of the position of C \[m\], per second.
    pub position: DerivativeLimits,
    /// Limits of the orientation \[rad\], per second.
    pub orientation: DerivativeLimits,
    /// Factor on the limits for autonomous motions: onto the setpoint, and home.
    pub autonomous_scale: f64,
}

impl Limits {
    /// Velocity, acceleration and jerk times a factor.
    pub fn scaled(&self, scale: f64) -> Self {
        Self {
            position: self.position.scaled(scale),
            orientation: self.orientation.scaled(scale),
            autonomous_scale: self.autonomous_scale,
        }
    }
}

impl Limits {
    /// Accelerations times a factor, and the velocities that are stopped within the same distance.
    pub fn scaled_at_equal_stopping_distance(&self, scale: f64) -> Self {
        let scaled = |limits: &DerivativeLimits| DerivativeLimits {
            velocity: scale.sqrt() * limits.velocity,
            acceleration: scale * limits.acceleration,
            jerk: limits.jerk,
        };
        Self { position: scaled(&self.position), orientation: scaled(&self.orientation), ..*self }
    }

    /// Accelerations that are not below a present one.
    pub(in crate::control) fn containing(&self, present: &Acceleration) -> Self {
        let mut limits = *self;
        for (limits, present) in
            [(&mut limits.orientation, &present.angular), (&mut limits.position, &present.linear)]
        {
            limits.acceleration = limits.acceleration.max(present.norm());
        }
        limits
    }
}

/// Largest magnitudes of the derivatives of a position \[m\] or an orientation \[rad\], per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DerivativeLimits {
    /// Largest magnitude of the first derivative \[m/s\] or \[rad/s\].
    pub velocity: f64,
    /// Largest magnitude of the second derivative \[m/s^2\] or \[rad/s^2\].
    pub acceleration: f64,
    /// Largest magnitude of the third derivative \[m/s^3\] or \[rad/s^3\].
    pub jerk: f64,
}

impl DerivativeLimits {
    /// All three times a factor.
    pub fn scaled(&self, scale: f64) -> Self {
        Self {
            velocity: scale * self.velocity,
            acceleration: scale * self.acceleration,
            jerk: scale * self.jerk,
        }
    }
}
