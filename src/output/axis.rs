//! Linear axes: range, round ticks, numbers that all have the same format.

use core::ops::Range;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::*;

/// Range and ticks of a linear axis.
#[derive(Clone)]
pub struct Axis {
    low: f64,
    high: f64,
    ticks: Vec<f64>,
    /// Power of ten taken out of the numbers and put beside the unit.
    exponent: i32,
    decimals: usize,
}

impl Axis {
    /// Axis that covers the values and a `margin` as a share of their span, with about `count` ticks at most.
    pub fn new(values: impl Iterator<Item = f64>, margin: f64, count: f64) -> Self {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let size = low.abs().max(high.abs());
        // Below this span the numbers at the ticks would become too long: the line counts as flat.
        let flat = high - low <= 1e-6 * size.max(1e-6);
        let around = if size > 1e-6 { 0.05 * size } else { 1.0 };
        let border = if flat { around } else { margin * (high - low) };
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

        let order = low.abs().max(high.abs()).log10().floor() as i32;
        let exponent = if (-2..6).contains(&order) { 0 } else { order.div_euclid(3) * 3 };
        Self { low, high, ticks, exponent, decimals: (exponent - power).max(0) as usize }
    }

    /// Both axes of a plane that contains the points with a `margin` as a share of their span; a length of one axis is
    /// as long on the page as of the other. `room` is the size of the plot.
    pub fn with_equal_scales(points: &[(f64, f64)], margin: f64, room: [f64; 2], count: f64) -> [Self; 2] {
        let ends = |of: fn(&(f64, f64)) -> f64| {
            let values = points.iter().map(of);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let mut ends = [ends(|point| point.0), ends(|point| point.1)];
        let spans =
            ends.iter().zip(room).map(|((low, high), room)| (1.0 + 2.0 * margin) * (high - low) / room);
        let per_unit = spans.fold(0.0, f64::max);
        for ((low, high), room) in ends.iter_mut().zip(room) {
            let more = 0.5 * (per_unit * room - (*high - *low));
            (*low, *high) = (*low - more, *high + more);
        }
        ends.map(|(low, high)| Self::new([low, high].into_iter(), 0.0, count))
    }

    /// The axis with its lowest value where its highest was.
    pub fn reversed(self) -> Self {
        Self { low: self.high, high: self.low, ..self }
    }

    /// Axis title with the power of ten of its numbers: turns `position [mm]` into `position [10⁻⁶ mm]` where the numbers need it.
    pub fn label(&self, label: &str) -> String {
        if self.exponent == 0 {
            return label.into();
        }
        let power = power_of_ten(self.exponent);
        match label.split_once('[') {
            Some((quantity, unit)) => format!("{quantity}[{power} {unit}"),
            None => format!("{label} [{power}]"),
        }
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
        format!("{:.*}", self.decimals, value / 10f64.powi(self.exponent)).replace('-', "\u{2212}")
    }
}

/// Power of ten as text, such as `10⁻⁶`.
pub fn power_of_ten(exponent: i32) -> String {
    let raised = |digit: u32| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize);
    let digits = format!("{exponent}");
    let power: String = digits.chars().map(|c| c.to_digit(10).and_then(raised).unwrap_or('⁻')).collect();
    format!("10{power}")
}
