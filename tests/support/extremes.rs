//! Quantities of a motion, what is allowed of each, and the largest that was seen.

/// Part by which the true motion may exceed a limit: the loop's own error.
pub const MOTION_ALLOWANCE: f64 = 0.02;
/// Part by which the reference may exceed a limit: rounding.
pub const REFERENCE_ALLOWANCE: f64 = 1e-6;

/// A quantity of which the largest value counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// True velocity of C over its limit.
    Velocity,
    /// True angular velocity over its limit.
    AngularVelocity,
    /// True rate of the fastest leg over `actuator.max_rate_m_s`.
    LegRate,
    /// True acceleration of C over the limit of reference and feedback together.
    Acceleration,
    /// True angular acceleration over that limit.
    AngularAcceleration,
    /// Part of the stroke margin that the true platform used; 1 is the end stop, above it is the speed of the impact.
    Stroke,
    /// Distance of the true pose beyond the envelope, or beyond where control began outside of it, over what is allowed.
    Envelope,
    /// True condition over its limit.
    Condition,
    /// True distance from the reference while engaging, over the following limit.
    Engaging,
    /// True distance from the reference in any other state, over the following limit.
    Following,
    /// Velocity or angular velocity of the reference over its limit.
    ReferenceVelocity,
    /// Acceleration or angular acceleration of the reference over its limit.
    ReferenceAcceleration,
    /// Jerk or angular jerk of the reference over its limit.
    ReferenceJerk,
    /// Part of the stroke margin that the reference used, beyond where control began.
    ReferenceStroke,
}

impl Quantity {
    pub const ALL: [Self; 14] = [
        Self::Velocity,
        Self::AngularVelocity,
        Self::LegRate,
        Self::Acceleration,
        Self::AngularAcceleration,
        Self::Stroke,
        Self::Envelope,
        Self::Condition,
        Self::Engaging,
        Self::Following,
        Self::ReferenceVelocity,
        Self::ReferenceAcceleration,
        Self::ReferenceJerk,
        Self::ReferenceStroke,
    ];

    /// The largest value that is no violation.
    pub fn allowed(self) -> f64 {
        match self {
            Self::Velocity
            | Self::AngularVelocity
            | Self::LegRate
            | Self::Acceleration
            | Self::AngularAcceleration
            | Self::Condition => 1.0 + MOTION_ALLOWANCE,
            Self::Stroke | Self::Envelope | Self::Engaging | Self::Following => 1.0,
            Self::ReferenceVelocity | Self::ReferenceAcceleration | Self::ReferenceJerk => {
                1.0 + REFERENCE_ALLOWANCE
            }
            Self::ReferenceStroke => REFERENCE_ALLOWANCE,
        }
    }

    pub const fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::AngularVelocity => "angular velocity",
            Self::LegRate => "leg rate",
            Self::Acceleration => "acceleration",
            Self::AngularAcceleration => "angular acceleration",
            Self::Stroke => "stroke",
            Self::Envelope => "envelope",
            Self::Condition => "condition",
            Self::Engaging => "engaging",
            Self::Following => "following",
            Self::ReferenceVelocity => "reference velocity",
            Self::ReferenceAcceleration => "reference acceleration",
            Self::ReferenceJerk => "reference jerk",
            Self::ReferenceStroke => "reference stroke",
        }
    }
}

/// Largest value of each quantity, and the instant at which it occurred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    value: [f64; Quantity::ALL.len()],
    at_ns: [u64; Quantity::ALL.len()],
}

impl Default for Extremes {
    fn default() -> Self {
        Self { value: [f64::NEG_INFINITY; Quantity::ALL.len()], at_ns: [0; Quantity::ALL.len()] }
    }
}

impl Extremes {
    /// The largest value so far; minus infinity if the quantity was never measured.
    pub fn of(&self, quantity: Quantity) -> f64 {
        self.value[quantity as usize]
    }

    /// The instant of that value.
    pub fn instant_ns(&self, quantity: Quantity) -> u64 {
        self.at_ns[quantity as usize]
    }

    /// A value that is not a number counts as infinite.
    pub fn add(&mut self, quantity: Quantity, value: f64, at_ns: u64) {
        let value = if value.is_nan() { f64::INFINITY } else { value };
        if value > self.of(quantity) {
            (self.value[quantity as usize], self.at_ns[quantity as usize]) = (value, at_ns);
        }
    }

    pub fn merge(&mut self, other: &Self) {
        for quantity in Quantity::ALL {
            self.add(quantity, other.of(quantity), other.instant_ns(quantity));
        }
    }

    /// Every quantity beyond what is allowed, with its value.
    pub fn violations(&self) -> Vec<(Quantity, f64)> {
        let values = Quantity::ALL.into_iter().map(|quantity| (quantity, self.of(quantity)));
        values.filter(|(quantity, value)| *value > quantity.allowed()).collect()
    }
}
