//! Lengths, angles and times of the command line, each with its unit: `5um`, `-3arcsec`, `0.1deg`.
//!
//! A number without unit is refused, because it has two likely readings. Zero needs no unit.

use hexad_machine::text::excerpt::stranger;
use hexad_machine::text::units::{ANGLES, LENGTHS, TIMES, Units, in_letters, names};

/// Bounds of a length and of an angle, larger than any machine.
const LENGTH_BOUNDS: [&str; 2] = ["-1e6m", "1e6m"];
const ANGLE_BOUNDS: [&str; 2] = ["-1e6rad", "1e6rad"];

/// Reader of a value of the command line, in SI units.
type Reader = fn(&str) -> Result<f64, String>;

/// Quantity of an option.
struct Quantity {
    /// Noun with its article.
    noun: &'static str,
    units: Units,
    /// Units that people mean when they write none.
    likely: [&'static str; 2],
}

const LENGTH: Quantity = Quantity { noun: "a length", units: LENGTHS, likely: ["mm", "m"] };
const ANGLE: Quantity = Quantity { noun: "an angle", units: ANGLES, likely: ["deg", "rad"] };
const TIME: Quantity = Quantity { noun: "a time", units: TIMES, likely: ["ms", "s"] };

/// Time \[s\] within bounds, which are written as the time is.
pub fn time_within(text: &str, bounds: [&str; 2]) -> Result<f64, String> {
    TIME.read(text, bounds)
}

/// Length \[m\].
pub fn length(text: &str) -> Result<f64, String> {
    length_within(text, LENGTH_BOUNDS)
}

/// Length \[m\] within bounds, which are written as the length is.
pub fn length_within(text: &str, bounds: [&str; 2]) -> Result<f64, String> {
    LENGTH.read(text, bounds)
}

/// Angle \[rad\].
pub fn angle(text: &str) -> Result<f64, String> {
    angle_within(text, ANGLE_BOUNDS)
}

/// Angle \[rad\] within bounds, which are written as the angle is.
pub fn angle_within(text: &str, bounds: [&str; 2]) -> Result<f64, String> {
    ANGLE.read(text, bounds)
}

/// Values with commas between them. `example` is such a text.
pub fn list<const N: usize>(text: &str, readers: [Reader; N], example: &str) -> Result<[f64; N], String> {
    let parts: Vec<_> = text.split(',').collect();
    let parts: [&str; N] = parts.try_into().map_err(|_| format!("must be {N} values, as in {example}"))?;
    let mut values = [0.0; N];
    for ((value, read), part) in values.iter_mut().zip(readers).zip(parts) {
        *value = read(part).map_err(|error| format!("{part} {error}, as in {example}"))?;
    }
    Ok(values)
}

impl Quantity {
    /// The value in SI units.
    fn read(&self, text: &str, [low, high]: [&str; 2]) -> Result<f64, String> {
        let text = text.trim();
        let [likely, other] = self.likely;
        match self.value(text) {
            Some(value) if self.value(low) <= Some(value) && Some(value) <= self.value(high) => Ok(value),
            Some(_) => Err(format!("must be in [{low}, {high}]")),
            None if text.parse().is_ok_and(f64::is_finite) => {
                Err(format!("has no unit: say {text}{likely} or {text}{other}"))
            }
            None => {
                let (units, stranger) = (names(self.units), stranger(text));
                Err(format!("must be {} in {units}, for example 5{likely}{stranger}", self.noun))
            }
        }
    }

    /// The value in SI units of a number with unit, or of zero.
    fn value(&self, text: &str) -> Option<f64> {
        let text = in_letters(text);
        let in_unit = |(unit, factor): &(&str, f64)| {
            let number: f64 = text.strip_suffix(unit)?.trim_end().parse().ok()?;
            Some(number * factor)
        };
        let zero = || text.parse().ok().filter(|number| *number == 0.0);
        self.units.iter().find_map(in_unit).or_else(zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_a_unit() {
        let degree = 1.0_f64.to_radians();
        let lengths = ["5m", "5mm", "5um", "5µm", "5 μm", "-5nm", "5e3nm", "0", "-0.0", "+.5mm"].map(length);
        let expected = [5.0, 5e-3, 5e-6, 5e-6, 5e-6, -5e-9, 5e-6, 0.0, 0.0, 5e-4];
        let angles = ["3rad", "20mrad", "20 urad", "0.1deg", "-0.1°", "3arcmin", "3arcsec", "0"].map(angle);
        let expected_angles =
            [3.0, 0.02, 2e-5, 0.1 * degree, -0.1 * degree, degree / 20.0, degree / 1200.0, 0.0];
        let values = lengths.into_iter().zip(expected).chain(angles.into_iter().zip(expected_angles));
        for (value, expected) in values {
            let value = value.unwrap();
            assert!((value - expected).abs() <= 1e-15 * expected.abs(), "{value} is not {expected}");
        }
    }

    #[test]
    fn what_has_no_reading_or_two_is_refused() {
        let lengths = "must be a length in m, mm, um, nm, for example 5mm";
        for (text, words) in [
            ("5", "has no unit: say 5mm or 5m"),
            ("-0.25", "has no unit: say -0.25mm or -0.25m"),
            ("5deg", lengths),
            ("5cm", lengths),
            ("mm", lengths),
            ("inf", lengths),
            ("", lengths),
            ("infm", "must be in [-1e6m, 1e6m]"),
            ("NaNmm", "must be in [-1e6m, 1e6m]"),
            ("-2e6m", "must be in [-1e6m, 1e6m]"),
        ] {
            assert_eq!(length(text).unwrap_err(), words, "{text}");
        }
        assert_eq!(angle("5").unwrap_err(), "has no unit: say 5deg or 5rad");
        let angles = "must be an angle in rad, mrad, urad, deg, arcmin, arcsec, for example 5deg";
        assert_eq!(angle("5mm").unwrap_err(), angles);
        assert_eq!(angle_within("90.1deg", ["0deg", "90deg"]).unwrap_err(), "must be in [0deg, 90deg]");
        assert!(angle_within("90deg", ["0deg", "90deg"]).is_ok());
    }

    #[test]
    fn a_list_has_as_many_values_as_it_should() {
        let read = |text: &str| list(text, [angle, length], "0,5mm");
        assert_eq!(read("0, -5mm"), Ok([0.0, -5e-3]));
        assert_eq!(read("0").unwrap_err(), "must be 2 values, as in 0,5mm");
        assert_eq!(read("0,5").unwrap_err(), "5 has no unit: say 5mm or 5m, as in 0,5mm");
    }
}
