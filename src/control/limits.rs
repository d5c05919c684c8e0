//! What a reference may ask for, and which limits a cycle is at.
//!
//! | bit | limit | bound | at the bound |
//! | --- | --- | --- | --- |
//! | 0 | force | `actuator.max_force_n` | the force keeps its gravity part and loses the same share of the rest |
//! | 1 | force rate | `limits.force_rate_n_s` | the change of force loses the same share on every leg |
//! | 2 | stroke | `actuator.*_length_m` where the setpoint could be stopped | refused |
//! | 3 | leg rate | `actuator.max_rate_m_s` | refused |
//! | 4 | envelope | `[envelope]` | refused |
//! | 5 | velocity | `limits.velocity_*` | refused |
//! | 6 | acceleration | `limits.acceleration_*` | refused |
//! | 7 | jerk | `limits.jerk_*` | refused |
//! | 8 | following error | `control.following_*` | fault |
//! | 9 | condition | `limits.condition` where the platform is; where the setpoint could be stopped | stop, fault; refused |
//!
//! hexad does not bend a setpoint: it follows it or it comes to rest. A refused setpoint is as good as none,
//! so one wrong message among good ones is ridden through, and a stream of them ends in a stop.

/// Numbers of the limits: bits of what a cycle is limited by, or near.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Limit {
    Force = 0,
    ForceRate = 1,
    Stroke = 2,
    LegRate = 3,
    Envelope = 4,
    Velocity = 5,
    Acceleration = 6,
    Jerk = 7,
    Following = 8,
    Condition = 9,
}

impl Limit {
    /// Every limit, in the order of their bits.
    pub const ALL: [Self; 10] = [
        Self::Force,
        Self::ForceRate,
        Self::Stroke,
        Self::LegRate,
        Self::Envelope,
        Self::Velocity,
        Self::Acceleration,
        Self::Jerk,
        Self::Following,
        Self::Condition,
    ];

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Force => "force",
            Self::ForceRate => "force rate",
            Self::Stroke => "stroke",
            Self::LegRate => "leg rate",
            Self::Envelope => "envelope",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Following => "following error",
            Self::Condition => "condition",
        }
    }
}

/// A set of limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limiting(pub u32);

/// From this share of a bound on a cycle counts as limited by it: the operator hears of it before it bites.
const NEAR: f64 = 0.9;

impl Limiting {
    /// With one more.
    pub fn with(self, limit: Limit, is_limiting: bool) -> Self {
        Self(self.0 | u32::from(is_limiting) << limit as u32)
    }

    /// Adds a limit if a share of its bound is near 1; true if it is not beyond. NaN is beyond.
    pub fn keeps(&mut self, limit: Limit, share: f64) -> bool {
        *self = self.with(limit, share > NEAR);
        share <= 1.0
    }

    pub fn contains(self, limit: Limit) -> bool {
        self.0 & 1 << limit as u32 != 0
    }
}

/// Largest magnitudes of a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    pub position: AxisLimits,
    pub orientation: AxisLimits,
    /// Of the motions onto the setpoint and home: they use this share of the velocity and acceleration.
    pub own_share: f64,
}

/// \[m\] or \[rad\], per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    pub velocity: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

impl AxisLimits {
    /// A gentler motion of the same kind.
    pub fn share(&self, share: f64) -> Self {
        Self {
            velocity: share * self.velocity,
            acceleration: share * self.acceleration,
            jerk: share * self.jerk,
        }
    }
}
