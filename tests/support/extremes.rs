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

/// Of each quantity the name, and the largest value that is no violation; in the order of their declaration.
const TABLE: [(Quantity, &str, f64); 14] = [
    (Quantity::Velocity, "velocity", MOTION),
    (Quantity::AngularVelocity, "angular velocity", MOTION),
    (Quantity::LegRate, "leg rate", MOTION),
    (Quantity::Acceleration, "acceleration", MOTION),
    (Quantity::AngularAcceleration, "angular acceleration", MOTION),
    (Quantity::Stroke, "stroke", 1.0),
    (Quantity::Envelope, "envelope", 1.0),
    (Quantity::Condition, "condition", MOTION),
    (Quantity::Engaging, "engaging", 1.0),
    (Quantity::Following, "following", 1.0),
    (Quantity::ReferenceVelocity, "reference velocity", REFERENCE),
    (Quantity::ReferenceAcceleration, "reference acceleration", REFERENCE),
    (Quantity::ReferenceJerk, "reference jerk", REFERENCE),
    (Quantity::ReferenceStroke, "reference stroke", REFERENCE_ALLOWANCE),
];
const MOTION: f64 = 1.0 + MOTION_ALLOWANCE;
const REFERENCE: f64 = 1.0 + REFERENCE_ALLOWANCE;

impl Quantity {
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.into_iter().map(|(quantity, ..)| quantity)
    }

    /// The largest value that is no violation.
    pub fn allowed(self) -> f64 {
        TABLE[self as usize].2
    }

    pub const fn name(self) -> &'static str {
        TABLE[self as usize].1
    }
}

/// Largest value of each quantity, and the instant at which it occurred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    value: [f64; TABLE.len()],
    at_ns: [u64; TABLE.len()],
}

impl Default for Extremes {
    fn default() -> Self {
        Self { value: [f64::NEG_INFINITY; TABLE.len()], at_ns: [0; TABLE.len()] }
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
        for quantity in Quantity::all() {
            self.add(quantity, other.of(quantity), other.instant_ns(quantity));
        }
    }

    /// Every quantity beyond what is allowed, with its value.
    pub fn violations(&self) -> Vec<(Quantity, f64)> {
        let values = Quantity::all().map(|quantity| (quantity, self.of(quantity)));
        values.filter(|(quantity, value)| *value > quantity.allowed()).collect()
    }
}
