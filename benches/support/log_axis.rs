//! Logarithmic axis: its range, its ticks and their numbers.

use std::ops::Range;

use hexad::output::axis::power_of_ten;
use hexad::output::svg::UNIT;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::Ranged;

/// Least gap between the numbers of an axis.
pub const NUMBER_GAP: i32 = 6 * UNIT;
/// Border of a range, as a share of it on the logarithmic axis.
const BORDER: f64 = 0.05;

/// Range of a logarithmic axis that contains these values, with a border; those that are not finite and positive count
/// for nothing.
pub fn log_range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let values = values.filter(|value| value.is_finite() && *value > 0.0).map(f64::log10);
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
    let border = (BORDER * (high - low)).max(0.05);
    10f64.powf(low - border)..10f64.powf(high + border)
}

/// Range and ticks of a logarithmic axis.
#[derive(Clone)]
pub struct LogAxis {
    range: Range<f64>,
    ticks: Vec<f64>,
    /// Whether all numbers are written as decimals; else all have a power of ten.
    is_decimal: bool,
}

/// Numbers that are short as decimals.
const DECIMALS: Range<f64> = 0.009..1.1e5;

impl LogAxis {
    /// Ticks at 1, 2 and 5 times the powers of ten where their numbers have room, else at the powers of ten, at every
    /// second one, and so on. `extent` is the room that a number takes along the axis.
    pub fn new(range: &Range<f64>, length: i32, extent: impl Fn(&str) -> i32) -> Self {
        let strides = (1..).map(|stride| (&[1.0][..], stride));
        let choices = [(&[1.0, 2.0, 5.0][..], 1)].into_iter().chain(strides);
        let axes = choices.map(|(leads, stride)| {
            let (low, high) = (range.start.log10().floor() as i32, range.end.log10().ceil() as i32);
            let powers = (low..=high).filter(|power| power.rem_euclid(stride) == 0);
            let ticks = powers.flat_map(|power| leads.iter().map(move |lead| lead * 10f64.powi(power)));
            let ticks: Vec<_> = ticks.filter(|tick| range.contains(tick)).collect();
            let is_decimal = ticks.iter().all(|tick| DECIMALS.contains(tick));
            Self { range: range.clone(), ticks, is_decimal }
        });
        let has_room = |axis: &Self| {
            let mut numbers = axis.ticks.iter().map(|tick| {
                let half = 0.5 * f64::from(extent(&axis.format_ext(tick)));
                let place = f64::from(axis.map(tick, (0, length)));
                (place - half, place + half)
            });
            let mut last = f64::NEG_INFINITY;
            numbers.all(|(start, end)| core::mem::replace(&mut last, end) <= start)
        };
        let mut axes = axes;
        axes.find(has_room).unwrap_or(Self { range: range.clone(), ticks: vec![], is_decimal: true })
    }
}

impl Ranged for LogAxis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (start, end): (i32, i32)) -> i32 {
        let share = (value / self.range.start).ln() / (self.range.end / self.range.start).ln();
        start + (f64::from(end - start) * share).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Light points would draw a second, finer grid.
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for LogAxis {
    fn format_ext(&self, value: &f64) -> String {
        // A hair more, so that 1000 does not count as 999.99.
        let exponent = (value.log10() + 1e-9).floor() as i32;
        let lead = (value / 10f64.powi(exponent)).round();
        match () {
            () if self.is_decimal => format!("{:.*}", (-exponent).max(0) as usize, value),
            () if lead == 1.0 => power_of_ten(exponent),
            () => format!("{lead}·{}", power_of_ten(exponent)),
        }
    }
}

#[cfg(test)]
mod tests {
    use hexad::output::svg::{LABEL_SIZE, text_width};

    use super::*;

    fn numbers(range: Range<f64>, length: i32) -> Vec<String> {
        let axis = LogAxis::new(&range, length, |number| text_width(number, LABEL_SIZE));
        axis.ticks.iter().map(|tick| axis.format_ext(tick)).collect()
    }

    #[test]
    fn numbers_of_an_axis_have_one_format() {
        let decimals = numbers(0.05..9e4, 100_000);
        assert_eq!(decimals.get(..5), Some(&["0.05", "0.1", "0.2", "0.5", "1"].map(String::from)[..]));
        assert_eq!(decimals.get(17..), Some(&["20000", "50000"].map(String::from)[..]));
        let powers = numbers(0.004..2.1, 100_000);
        assert_eq!(powers.get(..3), Some(&["5·10⁻³", "10⁻²", "2·10⁻²"].map(String::from)[..]));
        assert_eq!(powers.get(7..), Some(&["10⁰", "2·10⁰"].map(String::from)[..]));
    }

    #[test]
    fn numbers_have_room() {
        assert_eq!(numbers(0.9..110.0, 1000), ["1", "10", "100"]);
        assert_eq!(numbers(1e-9..1.0, 2000), ["10⁻⁸", "10⁻⁶", "10⁻⁴", "10⁻²"]);
    }

    #[test]
    fn ranges_contain_what_is_drawn() {
        let range = log_range([3.0, 40.0, f64::NAN, 0.0].into_iter());
        assert!(range.start < 3.0 && range.end > 40.0 && range.end < 60.0, "{range:?}");
    }
}
