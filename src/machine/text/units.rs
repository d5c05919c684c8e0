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
