//! Linear axes of all charts: range, round ticks, numbers of one format, prefix of the unit.
//!
//! `page/axis.js` computes the same in pages.

use core::ops::Range;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::*;

use hexad_machine::text::numbers::fixed;

/// Values whose span is a smaller share of their size are constant: numbers of four bytes have seven digits.
const FLAT_SHARE: f64 = 1e-6;
/// Values within this span are constant, and smaller values are zero: they are rounding errors.
const FLAT_SPAN: f64 = 1e-9;
/// Largest ratio of a common axis to the range of a component that is readable on it.
const MAX_COMMON_RATIO: f64 = 20.0;
/// Units that take prefixes, alone or divided by another one, each with its greatest power of ten.
const PREFIXED_UNITS: [(&str, i32); 4] = [("m", 3), ("rad", 3), ("s", 0), ("N", 9)];
const PREFIXES: [(i32, &str); 7] =
    [(-12, "p"), (-9, "n"), (-6, "µ"), (-3, "m"), (3, "k"), (6, "M"), (9, "G")];

/// Range and ticks of a linear axis.
#[derive(Clone)]
pub struct Axis {
    low: f64,
    high: f64,
    ticks: Vec<f64>,
    label: String,
    /// Power of ten taken out of the numbers and put into the unit.
    exponent: i32,
    /// Power of ten of the distance of the ticks.
    step_power: i32,
}

impl Axis {
    /// Axis that covers the values and a `margin` as a share of their span, with about `count` ticks at most. `label` is
    /// the quantity with its unit, such as `position [m]`.
    pub fn new(label: &str, values: impl Iterator<Item = f64>, margin: f64, count: f64) -> Self {
        let (low, high) = range_of(values);
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let size = low.abs().max(high.abs());
        let around = if size > FLAT_SPAN { 0.05 * size } else { 1.0 };
        let border = if is_flat(low, high) { around } else { margin * (high - low) };
        let (low, high) = (low - border, high + border);

        let rough = (high - low) / count;
        let mut power = rough.log10().floor() as i32;
        let lead = [1.0, 2.0, 5.0].into_iter().find(|lead| lead * 10f64.powi(power) >= rough);
        power += i32::from(lead.is_none());
        let step = lead.unwrap_or(1.0) * 10f64.powi(power);
        // A tick just outside is worth a hair of space: a run that ends at 9.999 s still shows 10 s.
        let (first, last) = ((low / step - 0.02).ceil(), (high / step + 0.02).floor());
        let (low, high) = (low.min(first * step), high.max(last * step));
        let ticks = (first as i64..=last as i64).map(|tick| tick as f64 * step).collect();
        let exponent = displayed_exponent(label, first.abs().max(last.abs()) * step);
        // 1099.995 mm rather than 1.099995 m.
        let exponent = if power < -4 { exponent.min(-3) } else { exponent };
        Self { low, high, ticks, label: label.into(), exponent, step_power: power }
    }

    /// Both axes of a plane that contains the points with a `margin` as a share of their span; a length of one axis is
    /// as long on the page as of the other, and both have one prefix. `room` is the size of the plot.
    pub fn with_equal_scales(
        labels: [&str; 2],
        points: &[(f64, f64)],
        margin: f64,
        room: [f64; 2],
        count: f64,
    ) -> [Self; 2] {
        let mut ends =
            [range_of(points.iter().map(|point| point.0)), range_of(points.iter().map(|point| point.1))];
        let spans =
            ends.iter().zip(room).map(|((low, high), room)| (1.0 + 2.0 * margin) * (high - low) / room);
        let per_unit = spans.fold(0.0, f64::max);
        for ((low, high), room) in ends.iter_mut().zip(room) {
            let more = 0.5 * (per_unit * room - (*high - *low));
            (*low, *high) = (*low - more, *high + more);
        }
        let [(left, right), (bottom, top)] = ends;
        let [x_label, y_label] = labels;
        let x = Self::new(x_label, [left, right].into_iter(), 0.0, count);
        let y = Self::new(y_label, [bottom, top].into_iter(), 0.0, count);
        let exponent = x.exponent.max(y.exponent);
        [x, y].map(|axis| Self { exponent, ..axis })
    }

    /// The axis with its lowest value where its highest was.
    pub fn reversed(self) -> Self {
        Self { low: self.high, high: self.low, ..self }
    }

    /// Quantity with the unit of the numbers, such as `position [µm]`.
    pub fn title(&self) -> String {
        prefixed(&self.label, self.exponent)
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (start, end): (i32, i32)) -> i32 {
        let share = (value - self.low) / (self.high - self.low);
        start + (f64::from(end - start) * share).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Light points would draw a second, finer grid.
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        let decimals = (self.exponent - self.step_power).max(0) as usize;
        fixed(value / 10f64.powi(self.exponent), decimals).replace('-', "\u{2212}")
    }
}

/// Whether components must have an axis each: a common one would hide the shape of one of them.
pub fn need_own_axes(ranges: &[(f64, f64)]) -> bool {
    let (low, _) = range_of(ranges.iter().map(|range| range.0));
    let (_, high) = range_of(ranges.iter().map(|range| range.1));
    ranges.iter().any(|(l, h)| !is_flat(*l, *h) && high - low > MAX_COMMON_RATIO * (h - l))
}

/// Least and largest value; infinite in the wrong order if there is none.
pub fn range_of(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

fn is_flat(low: f64, high: f64) -> bool {
    high - low <= FLAT_SPAN.max(FLAT_SHARE * low.abs().max(high.abs()))
}

/// Power of ten to take out of numbers up to a size: if the unit takes prefixes, the largest number is from 1 to 1000;
/// else only very large and very small numbers have one.
pub fn displayed_exponent(label: &str, size: f64) -> i32 {
    if size < FLAT_SPAN {
        return 0;
    }
    // A hair more, so that 1000 does not count as 999.99.
    let order = (size.log10() + 1e-9).floor() as i32;
    let thousands = 3 * order.div_euclid(3);
    match greatest_prefix(label) {
        Some(greatest) => thousands.clamp(-12, greatest),
        None if (-2..6).contains(&order) => 0,
        None => thousands,
    }
}

/// Greatest power of ten of a prefix of the unit; `None` if the unit takes none.
fn greatest_prefix(label: &str) -> Option<i32> {
    let (_, unit) = label.split_once('[')?;
    let base = unit.split(['/', ' ', ']']).next()?;
    PREFIXED_UNITS.iter().find(|(name, _)| *name == base).map(|(_, greatest)| *greatest)
}

/// A label with a power of ten in its unit: `position [m]` as `position [mm]`, `angle [deg]` as `angle [10⁻³ deg]`.
pub fn prefixed(label: &str, exponent: i32) -> String {
    let prefix = PREFIXES.iter().find(|(power, _)| *power == exponent && greatest_prefix(label).is_some());
    match (label.split_once('['), prefix) {
        _ if exponent == 0 => label.into(),
        (Some((quantity, unit)), Some((_, prefix))) => format!("{quantity}[{prefix}{unit}"),
        (Some((quantity, unit)), None) => format!("{quantity}[{} {unit}", power_of_ten(exponent)),
        (None, _) => format!("{label} [{}]", power_of_ten(exponent)),
    }
}

/// Power of ten as text, such as `10⁻⁶`.
pub fn power_of_ten(exponent: i32) -> String {
    let raised = |digit: u32| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize);
    let digits = format!("{exponent}");
    let power: String = digits.chars().map(|c| c.to_digit(10).and_then(raised).unwrap_or('⁻')).collect();
    format!("10{power}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const LABELS: [&str; 6] =
        ["position [m]", "velocity [m/s]", "force [N]", "time [s]", "angle [deg]", "condition"];

    fn texts(axis: &Axis) -> Vec<String> {
        axis.ticks.iter().map(|tick| axis.format_ext(tick)).collect()
    }

    #[test]
    fn ticks_differ_and_are_short_over_twelve_decades() {
        // Evenly distributed in the square.
        let share = |k: usize, ratio: f64| (k as f64 * ratio).fract();
        for k in 0..20_000 {
            let label = LABELS[k % LABELS.len()];
            let sign = if (k / 6).is_multiple_of(2) { 1.0 } else { -1.0 };
            let middle = sign * 10f64.powf(12.0 * share(k, 0.754_877_666_246_692_7) - 8.0);
            let span = middle.abs() * 10f64.powf(6.0 * share(k, 0.569_840_290_998_053_2) - 5.0);
            let axis = Axis::new(label, [middle - span, middle + span].into_iter(), 0.05, 5.0);
            let texts = texts(&axis);
            let case = format!("{} from {} by {span}: {texts:?}", axis.title(), middle);
            assert!((2..=7).contains(&texts.len()), "{case}");
            assert!(texts.windows(2).all(|pair| pair[0] != pair[1]), "{case}");
            assert!(texts.iter().all(|text| text.chars().count() <= 9 && !text.contains('e')), "{case}");
            let largest = axis.ticks.iter().fold(0.0_f64, |most, tick| most.max(tick.abs()));
            let number = largest / 10f64.powi(axis.exponent);
            let is_bounded = if label == "time [s]" { number >= 0.99 } else { (0.01..1e6).contains(&number) };
            assert!(is_bounded || largest < 1e-9, "{case}: {number}");
        }
    }

    #[test]
    fn a_prefix_is_chosen_by_the_range() {
        let title = |label: &str, size: f64| Axis::new(label, [-size, size].into_iter(), 0.0, 4.0).title();
        for (label, size, expected) in [
            ("position [m]", 2e-5, "position [µm]"),
            ("position [m]", 0.04, "position [mm]"),
            ("position [m]", 1.2, "position [m]"),
            ("angle [rad]", 2e-3, "angle [mrad]"),
            ("force [N]", 2500.0, "force [kN]"),
            ("acceleration [m/s²]", 3e-3, "acceleration [mm/s²]"),
            ("torque [N m]", 5e4, "torque [kN m]"),
            ("time [s]", 7200.0, "time [s]"),
            ("angle [deg]", 2e-5, "angle [10⁻⁶ deg]"),
            ("angle [deg]", 0.05, "angle [deg]"),
            ("inertia [kg m²]", 2e6, "inertia [10⁶ kg m²]"),
            ("condition", 2e7, "condition [10⁶]"),
        ] {
            assert_eq!(title(label, size), expected);
        }
    }

    #[test]
    fn components_of_very_different_ranges_have_axes_of_their_own() {
        for (ranges, expected) in [
            (vec![(-1.0, 1.0), (-0.11, 0.11)], false),
            (vec![(-1.0, 1.0), (-0.04, 0.04)], true),
            // Both move alike, but far from each other.
            (vec![(0.95, 0.96), (0.1, 0.11)], true),
            (vec![(0.95, 1.05), (0.1, 0.2)], false),
            // A constant component is readable on every axis.
            (vec![(-1.0, 1.0), (0.95, 0.95)], false),
            (vec![(0.0, 25e-6), (0.135, 0.135)], true),
            (vec![(f64::INFINITY, f64::NEG_INFINITY), (0.0, 1.0)], false),
            (vec![], false),
        ] {
            assert_eq!(need_own_axes(&ranges), expected, "{ranges:?}");
        }
    }
}
