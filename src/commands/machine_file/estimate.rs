//! Estimates of numbers of a machine file, and their text.

/// A new value of a machine file.
#[derive(Clone, Debug, PartialEq)]
pub struct NewValue {
    /// Key from the top of the file, as in `platform.inertia_kg_m2.xx`.
    pub key: String,
    /// What the file states from now on.
    pub value: NewNumbers,
}

/// Number or array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum NewNumbers {
    /// A number.
    One(Estimate),
    /// An array, as of a vector or of the six legs.
    Array(Vec<Estimate>),
}

/// Estimate of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The number, in the unit of its key.
    pub value: f64,
    /// Its standard deviation, in the same unit; 0 if it is unknown.
    pub deviation: f64,
}

impl NewNumbers {
    /// The estimates in the order of the array.
    pub fn estimates(&self) -> &[Estimate] {
        match self {
            Self::One(estimate) => core::slice::from_ref(estimate),
            Self::Array(estimates) => estimates,
        }
    }

    /// The rounded numbers as TOML.
    pub fn toml(&self) -> String {
        self.written(Estimate::toml)
    }

    /// The standard deviations with two digits; `None` if all are unknown.
    pub fn deviations(&self) -> Option<String> {
        let is_known = self.estimates().iter().any(|estimate| estimate.deviation > 0.0);
        is_known.then(|| self.written(|estimate| number(rounded_to_digits(estimate.deviation, 2))))
    }

    fn written(&self, text: impl Fn(&Estimate) -> String) -> String {
        match self {
            Self::One(estimate) => text(estimate),
            Self::Array(estimates) => array(estimates.iter().map(text)),
        }
    }
}

impl Estimate {
    /// Significant digits of a number whose deviation is unknown.
    const DIGITS: usize = 6;

    /// The rounded number as TOML.
    pub fn toml(&self) -> String {
        number(self.rounded(self.value))
    }

    /// Whether a number of the file is the estimate, but for digits that the deviation does not justify.
    pub fn is_equal_to(&self, old: f64) -> bool {
        self.rounded(old) == self.rounded(self.value)
    }

    /// A number rounded to the fourth digit of the deviation, or with seven digits if that is more. Estimates belong
    /// together: the mass of platform and rods is known a hundred times better than either, and the moments of a flat
    /// plate add up. So digits that one number alone does not justify count.
    fn rounded(&self, x: f64) -> f64 {
        if !(self.deviation > 0.0 && self.deviation.is_finite()) {
            return rounded_to_digits(x, Self::DIGITS);
        }
        let places = |of: f64, digits: i32| digits - 1 - of.log10().floor() as i32;
        let by_deviation = places(self.deviation, 4);
        let is_small = x.abs() <= self.deviation;
        let decimals = if is_small { by_deviation } else { by_deviation.max(places(x.abs(), 7)) };
        match usize::try_from(decimals) {
            Ok(decimals) => format!("{x:.decimals$}").parse().unwrap_or(x),
            Err(_) => {
                let step = 10_f64.powi(-decimals);
                (x / step).round() * step
            }
        }
    }
}

/// Numbers as an array of TOML.
pub fn array(numbers: impl Iterator<Item = String>) -> String {
    format!("[{}]", numbers.collect::<Vec<_>>().join(", "))
}

fn rounded_to_digits(x: f64, digits: usize) -> f64 {
    format!("{x:.0$e}", digits - 1).parse().unwrap_or(x)
}

/// A number with the fewest digits that are read as it, without negative zero.
fn number(x: f64) -> String {
    format!("{:?}", x + 0.0)
}
