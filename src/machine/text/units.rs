//! Units in which people write times, lengths and angles: in the names of CSV columns and in values of the command line.

use core::f64::consts::PI;

/// Names of the units of a quantity, each with its factor to SI; the SI unit is the first.
pub type Units = &'static [(&'static str, f64)];

/// Units of a time.
pub const TIMES: Units = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];

/// Units of a length.
pub const LENGTHS: Units = &[("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("nm", 1e-9)];

/// Units of an angle.
pub const ANGLES: Units = &[
    ("rad", 1.0),
    ("mrad", 1e-3),
    ("urad", 1e-6),
    ("deg", PI / 180.0),
    ("arcmin", PI / 180.0 / 60.0),
    ("arcsec", PI / 180.0 / 3600.0),
];

/// Signs that people write in units, two characters of which look like a micro sign, and letters for them.
const SIGNS: [(&str, &str); 3] = [("°", "deg"), ("µ", "u"), ("μ", "u")];

/// The text with letters in the place of signs: `5 µm` as `5 um`.
pub fn in_letters(text: &str) -> String {
    SIGNS.iter().fold(text.to_owned(), |text, (sign, letters)| text.replace(sign, letters))
}

/// Units in which a person reads lengths and angles, each with its factor to SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionUnits {
    /// Unit of lengths.
    pub length: (&'static str, f64),
    /// Unit of angles.
    pub angle: (&'static str, f64),
}

impl Default for MotionUnits {
    /// Millimetres and degrees.
    fn default() -> Self {
        Self { length: ("mm", 1e-3), angle: ("deg", PI / 180.0) }
    }
}

impl MotionUnits {
    /// Reads a unit of length and one of angle, in any order: `nm,arcsec`.
    pub fn read(text: &str) -> Result<Self, String> {
        let text = in_letters(text);
        let words: Vec<_> = text.split(',').map(str::trim).collect();
        let of = |units: Units| units.iter().find(|(unit, _)| words.contains(unit)).copied();
        match (words.len(), of(LENGTHS), of(ANGLES)) {
            (2, Some(length), Some(angle)) => Ok(Self { length, angle }),
            _ => Err(format!(
                "must be a unit of length ({}) and one of angle ({}), for example nm,arcsec",
                names(LENGTHS),
                names(ANGLES)
            )),
        }
    }

    /// Unit of a task coordinate.
    pub fn of_axis(self, axis: usize) -> (&'static str, f64) {
        if axis < 3 { self.angle } else { self.length }
    }
}

/// Names of units, for people.
pub fn names(units: Units) -> String {
    units.iter().map(|(unit, _)| *unit).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_is_a_unit_of_length_and_one_of_angle() {
        let read = |text: &str| MotionUnits::read(text).map(|units| [units.length.0, units.angle.0]);
        assert_eq!(read("nm,arcsec"), Ok(["nm", "arcsec"]));
        assert_eq!(read("°, µm"), Ok(["um", "deg"]));
        for text in ["", "nm", "nm,um", "arcsec,deg", "nm,arcsec,mm", "nm,arcsecs", "inch,deg"] {
            let error = read(text).unwrap_err();
            assert!(
                error.starts_with("must be a unit of length (m, mm, um, nm) and one of angle (rad, "),
                "{error}"
            );
        }
    }
}
