//! Bounds of the numbers in a configuration.

use core::fmt;

use toml::de::DeValue;

use crate::text::numbers::{MAX_MAGNITUDE, MIN_POSITIVE_VALUE};

/// Bound of a number. Only one admits infinity.
#[derive(Clone, Copy)]
pub(super) enum Bound {
    Finite,
    /// At least [`MIN_POSITIVE_VALUE`].
    Positive,
    NotNegative,
    NotPositive,
    /// At least [`MIN_POSITIVE_VALUE`], or infinite: without a bound.
    PositiveOrInfinite,
    /// At least [`MIN_POSITIVE_VALUE`] and up to the limit.
    PositiveUpTo(f64),
    /// Both ends included.
    Within(f64, f64),
}

impl Bound {
    /// Requirement that a value violates, if any; `None` is a value that is no number.
    pub fn violation(self, value: Option<f64>) -> Option<String> {
        let Some(x) = value else {
            return Some(match self {
                Self::Finite => format!("must be {self}"),
                _ => format!("must be a number, {self}"),
            });
        };
        let admits = match self {
            Self::Finite => true,
            Self::Positive | Self::PositiveOrInfinite => x >= MIN_POSITIVE_VALUE,
            Self::NotNegative => x >= 0.0,
            Self::NotPositive => x <= 0.0,
            Self::PositiveUpTo(high) => x >= MIN_POSITIVE_VALUE && x <= high,
            Self::Within(low, high) => (low..=high).contains(&x),
        };
        match (x.abs() <= MAX_MAGNITUDE, admits) {
            (true, true) => None,
            (true, false) if x > 0.0 && x < MIN_POSITIVE_VALUE => {
                Some(format!("must be at least {MIN_POSITIVE_VALUE:e}"))
            }
            (true, false) => Some(format!("must be {self}")),
            (false, _) if matches!(self, Self::PositiveOrInfinite) => {
                (x != f64::INFINITY).then(|| format!("must be {self}"))
            }
            (false, _) => Some(format!("must be a finite number, at most {MAX_MAGNITUDE:e} in magnitude")),
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finite => write!(f, "a finite number"),
            Self::Positive => write!(f, "greater than 0"),
            Self::PositiveOrInfinite => write!(f, "greater than 0 and at most {MAX_MAGNITUDE:e}, or inf"),
            Self::NotNegative => write!(f, "at least 0"),
            Self::NotPositive => write!(f, "at most 0"),
            Self::PositiveUpTo(high) => write!(f, "greater than 0 and at most {high}"),
            Self::Within(low, high) => write!(f, "in [{low}, {high}]"),
        }
    }
}

/// Number of a value: a float, or an integer of at most 128 bits.
pub fn number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Integer(x) => i128::from_str_radix(x.as_str(), x.radix()).ok().map(|x| x as f64),
        DeValue::Float(x) => x.as_str().parse().ok(),
        _ => None,
    }
}

/// Integer of a value, of at most 32 bits.
pub(super) fn integer(value: &DeValue) -> Option<i32> {
    value.as_integer().and_then(|x| i32::from_str_radix(x.as_str(), x.radix()).ok())
}
