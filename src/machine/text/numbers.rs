//! Bounds of the numbers in files, and numbers as text.

use super::units::{MotionUnits, Units};

/// Largest magnitude of a number in a file. No quantity is larger in SI units, and the products of four such do not
/// overflow.
pub const MAX_MAGNITUDE: f64 = 1e12;

/// Smallest value of a quantity that must be positive. None is smaller in SI units: the inertia of a milligram within
/// a millimetre is 1e-12 kg m^2. The products of four such, and their inverses, are normal numbers.
pub const MIN_POSITIVE_VALUE: f64 = 1e-12;

/// Names of the six task coordinates.
pub const AXES: [&str; 6] = ["alpha", "beta", "gamma", "x", "y", "z"];

/// Factor from SI to the unit in which people read a task coordinate, and the name of that unit.
pub fn axis_unit(axis: usize) -> (f64, &'static str) {
    if axis < 3 { (1.0_f64.to_degrees(), "deg") } else { (1e3, "mm") }
}

/// Digits after the point with which people read the positions and angles of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionDigits {
    /// Of millimetres. Metres have one more and tenths of the stroke two less.
    pub mm: usize,
    /// Of degrees.
    pub deg: usize,
}

impl MotionDigits {
    /// Digits that show a resolution \[m\], \[rad\].
    pub fn new(resolution: [f64; 2]) -> Self {
        let [angle, .., length] = last_digits(resolution, MotionUnits::default());
        let [mm, deg] = [length, angle].map(|power| power.unsigned_abs() as usize);
        Self { mm, deg }
    }
}

/// Powers of ten of the last digits that show a resolution \[m\], \[rad\] of X in units. A finer resolution than a nanometre or a
/// millionth of a degree is not shown, and a coarser one than a thousandth of a millimetre or of a degree with digits of these.
pub fn last_digits([length_m, angle_rad]: [f64; 2], units: MotionUnits) -> [i32; 6] {
    core::array::from_fn(|axis| {
        let (_, factor) = units.of_axis(axis);
        let (_, usual) = MotionUnits::default().of_axis(axis);
        let step = if axis < 3 { angle_rad } else { length_m }.clamp(1e-6 * usual, 1e-3 * usual);
        // A hair more, so that a power of ten has the same digits however it was rounded.
        (0.01 + (step / factor).log10()).floor() as i32
    })
}

/// A number with three significant digits, with an exponent only where it is very large or small.
pub fn significant(x: f64) -> String {
    let magnitude = x.abs();
    match magnitude {
        _ if x == 0.0 => "0".into(),
        _ if !(9.995e-4..1e6).contains(&magnitude) => format!("{x:.2e}"),
        _ if magnitude < 9.995e-3 => format!("{x:.5}"),
        _ if magnitude < 9.995e-2 => format!("{x:.4}"),
        _ if magnitude < 0.9995 => format!("{x:.3}"),
        _ if magnitude < 9.995 => format!("{x:.2}"),
        _ if magnitude < 99.95 => format!("{x:.1}"),
        _ => format!("{x:.0}"),
    }
}

/// A value with three significant digits in the decimal unit that suits it: `12.3 um`.
pub fn readable(value: f64, units: Units) -> String {
    let decimal = |(unit, _): &&(&str, f64)| units.first().is_some_and(|(si, _)| unit.ends_with(si));
    let suits = |(_, factor): &&(&str, f64)| value.abs() >= 0.9995 * factor;
    let found = units.iter().filter(decimal).find(suits).or(units.iter().rfind(decimal));
    found.map_or_else(
        || significant(value),
        |(unit, factor)| format!("{} {unit}", significant(value / factor)),
    )
}

/// A number with so many digits after the point, and no negative zero.
pub fn fixed(number: f64, digits: usize) -> String {
    let text = format!("{number:.digits$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    if is_zero { text.trim_start_matches('-').into() } else { text }
}

/// A share in per cent, with three significant digits.
pub fn percent(share: f64) -> String {
    format!("{} %", significant(100.0 * share))
}

/// A configured share in per cent, with the digits that were configured and no others.
pub fn plain_percent(share: f64) -> String {
    let percent = 100.0 * share;
    format!("{} %", format!("{percent:.6e}").parse().unwrap_or(percent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::units::{ANGLES, LENGTHS, TIMES};

    #[test]
    fn numbers_have_three_digits() {
        for (x, text) in [
            (0.0, "0"),
            (1.234e-7, "1.23e-7"),
            (0.001234, "0.00123"),
            (0.01234, "0.0123"),
            (0.1234, "0.123"),
            (0.99996, "1.00"),
            (-1.234, "-1.23"),
            (12.34, "12.3"),
            (123.4, "123"),
            (12345.6, "12346"),
            (1.5e7, "1.50e7"),
        ] {
            assert_eq!(significant(x), text);
        }
        let digits = |length_m: f64| {
            let MotionDigits { mm, deg } = MotionDigits::new([length_m, 2.0 * length_m]);
            [mm, deg]
        };
        let lengths = [1e-4, 1e-6, 2.8e-7, 1e-7, 1e-9, 0.0].map(digits);
        assert_eq!(lengths, [[3, 3], [3, 4], [4, 5], [4, 5], [6, 6], [6, 6]]);
        // The smallest digit of a machine in other units: of 1 nm, 0.0036 arcsec; of 1 um, 3.6 arcsec.
        for (text, fine, coarse) in [("nm,arcsec", [-3, 0], [0, 3]), ("m,rad", [-8, -9], [-5, -6])] {
            let units = MotionUnits::read(text).unwrap();
            let digits = |step: f64| last_digits([step, step], units);
            let [fine_found, coarse_found] = [1e-9, 1e-3].map(|step| [digits(step)[0], digits(step)[5]]);
            assert_eq!((fine_found, coarse_found), (fine, coarse), "{text}");
        }
        assert_eq!(percent(0.00123), "0.123 %");
        assert_eq!([0.001, 0.07, 1.0].map(plain_percent), ["0.1 %", "7 %", "100 %"]);
    }

    #[test]
    fn a_value_has_the_unit_that_suits_it() {
        for (value, units, text) in [
            (1.5, LENGTHS, "1.50 m"),
            (0.9996, LENGTHS, "1.00 m"),
            (-0.02, LENGTHS, "-20.0 mm"),
            (3e-10, LENGTHS, "0.300 nm"),
            (5e-3, ANGLES, "5.00 mrad"),
            (1e-8, ANGLES, "0.0100 urad"),
            (0.1, TIMES, "100 ms"),
        ] {
            assert_eq!(readable(value, units), text);
        }
    }
}
