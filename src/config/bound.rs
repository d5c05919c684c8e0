//! What a number must be, and the words for it.

use core::fmt;

use toml::de::DeValue;

use crate::output::numbers::{LARGEST, SMALLEST};

/// What a number must be, besides finite.
#[derive(Clone, Copy)]
pub(super) enum Bound {
    Finite,
    /// At least [`SMALLEST`].
    Positive,
    NotNegative,
    NotPositive,
    /// At least [`SMALLEST`] and up to the limit.
    UpTo(f64),
    /// Both ends included.
    Within(f64, f64),
}

impl Bound {
    /// What is wrong with a value, if anything; `None` is a value that is no number.
    pub fn refusal(self, value: Option<f64>) -> Option<String> {
        let Some(x) = value else {
            return Some(match self {
                Self::Finite => format!("must be {self}"),
                _ => format!("must be a number, {self}"),
            });
        };
        let admits = match self {
            Self::Finite => true,
            Self::Positive => x >= SMALLEST,
            Self::NotNegative => x >= 0.0,
            Self::NotPositive => x <= 0.0,
            Self::UpTo(high) => x >= SMALLEST && x <= high,
            Self::Within(low, high) => (low..=high).contains(&x),
        };
        match (x.abs() <= LARGEST, admits) {
            (true, true) => None,
            (true, false) if x > 0.0 && x < SMALLEST => Some(format!("must be at least {SMALLEST:e}")),
            (true, false) => Some(format!("must be {self}")),
            (false, _) => Some(format!("must be a finite number, at most {LARGEST:e} in magnitude")),
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finite => write!(f, "a finite number"),
            Self::Positive => write!(f, "greater than 0"),
            Self::NotNegative => write!(f, "at least 0"),
            Self::NotPositive => write!(f, "at most 0"),
            Self::UpTo(high) => write!(f, "greater than 0 and at most {high}"),
            Self::Within(low, high) => write!(f, "in [{low}, {high}]"),
        }
    }
}

/// A float, or an integer that 128 bits hold.
pub(super) fn number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Integer(x) => i128::from_str_radix(x.as_str(), x.radix()).ok().map(|x| x as f64),
        DeValue::Float(x) => x.as_str().parse().ok(),
        _ => None,
    }
}

/// An integer that 32 bits hold.
pub(super) fn integer(value: &DeValue) -> Option<i32> {
    value.as_integer().and_then(|x| i32::from_str_radix(x.as_str(), x.radix()).ok())
}
