//! Points and lines on logarithmic axes, one chart or a grid of them, in the style of [`super::charts`].

use core::ops::Range;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use std::path::Path;

use super::charts::{
    Area, ChartError, DASHED_INK, DrawError, GRID, INK, LEGEND_LINE, MARGIN, PALETTE, SAMPLE, Stroke,
    TITLE_HEIGHT, UNIT, WIDTH, X_LABELS, Y_LABELS, finish, house_style, power_of_ten, rgb, text,
};
use super::files::write_whole;

const HEIGHT: i32 = 560 * UNIT;
/// Height of one chart of a grid.
const CELL_HEIGHT: i32 = 260 * UNIT;
/// A decade of an axis at least this long has three ticks, a shorter one has one.
const ROOMY_DECADE: f64 = (120 * UNIT) as f64;
const RADIUS: i32 = 45;
/// Width of a letter, on average, and height of a line of labels.
const LETTER: i32 = 62;
const LINE: i32 = 15 * UNIT;
/// From a point to the lowest flag above it, and to the labels left of it.
const POLE: i32 = 14 * UNIT;
const SIDESTEP: i32 = 34 * UNIT;

/// How a point is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    Disc,
    Ring,
}

/// Where the name of a point stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Label<'a> {
    None,
    /// In a column to the left of all points, for points one above the other.
    Left(&'a str),
    /// On a flagpole, for points side by side.
    Flag(&'a str),
}

/// One point.
#[derive(Debug, Clone, Copy)]
pub struct Point<'a> {
    /// Both positive.
    pub at: (f64, f64),
    pub mark: Mark,
    /// Index into the palette.
    pub color: usize,
    pub label: Label<'a>,
}

/// A line under the points.
#[derive(Debug, Clone)]
pub struct Line {
    pub points: Vec<(f64, f64)>,
    pub style: Stroke,
    /// Index into the palette; dashed lines are grey.
    pub color: usize,
    pub width: Width,
}

/// How wide a solid line is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// Pale: lies behind the points and means them all.
    Band,
    /// Carries the data.
    Curve,
    /// Joins what belongs together.
    Hair,
}

/// The chart.
#[derive(Debug, Clone, Default)]
pub struct Scatter<'a> {
    pub title: &'a str,
    pub x_label: &'a str,
    pub y_label: &'a str,
    /// Of the axes; what lies outside is not drawn.
    pub x: Range<f64>,
    pub y: Range<f64>,
    pub points: Vec<Point<'a>>,
    pub lines: Vec<Line>,
    /// What the marks and the lines mean, at the upper right.
    pub legend: Vec<(Sample, &'a str)>,
}

/// A mark or a line in the legend.
#[derive(Debug, Clone)]
pub enum Sample {
    Mark(Mark, usize),
    Line(Stroke, Width, usize),
}

/// The steps along the points that no other one beats in both coordinates; each step multiplies y by `better`
/// or less.
pub fn pareto_front(points: impl Iterator<Item = (f64, f64)>, better: f64) -> Vec<(f64, f64)> {
    let mut sorted: Vec<_> = points.collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut steps: Vec<(f64, f64)> = vec![];
    for (x, y) in sorted {
        match steps.last() {
            Some((_, lowest)) if y > better * lowest => {}
            Some((_, lowest)) => steps.extend([(x, *lowest), (x, y)]),
            None => steps.push((x, y)),
        }
    }
    steps
}

/// Charts side by side under one title and one legend.
#[derive(Debug, Clone)]
pub struct Grid<'a> {
    pub title: &'a str,
    pub legend: Vec<(Sample, &'a str)>,
    pub columns: usize,
    /// Row by row.
    pub charts: Vec<Scatter<'a>>,
}

impl Grid<'_> {
    /// Writes the charts as one SVG file, complete or not at all.
    pub fn write_svg(&self, path: &Path) -> Result<(), ChartError> {
        let rows = self.charts.len().div_ceil(self.columns.max(1));
        let head = TITLE_HEIGHT + LEGEND_LINE;
        let svg = drawn(head + rows as i32 * CELL_HEIGHT, |root| {
            root.draw_text(self.title, &text(15, HPos::Center), (WIDTH / 2, TITLE_HEIGHT * 3 / 5))?;
            let mut left = Y_LABELS + MARGIN;
            for (sample, label) in &self.legend {
                sample.draw(root, (left, TITLE_HEIGHT + LEGEND_LINE / 2), label)?;
                left += SAMPLE + width(label) + 5 * MARGIN;
            }
            let (_, cells) = root.split_vertically(head);
            let cells = cells.split_evenly((rows, self.columns));
            self.charts.iter().zip(&cells).try_for_each(|(chart, cell)| chart.draw_in(cell, 13))
        })?;
        Ok(write_whole(path, svg.as_bytes())?)
    }
}

/// An SVG text of this height.
pub(crate) fn drawn(
    height: i32,
    draw: impl FnOnce(&Area) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    let mut svg = String::new();
    {
        let size = (WIDTH.unsigned_abs(), height.unsigned_abs());
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root)?;
        root.present()?;
    }
    Ok(finish(&svg, height))
}

impl Scatter<'_> {
    /// Writes the chart as an SVG file, complete or not at all.
    pub fn write_svg(&self, path: &Path) -> Result<(), ChartError> {
        Ok(write_whole(path, drawn(HEIGHT, |root| self.draw_in(root, 15))?.as_bytes())?)
    }

    fn draw_in(&self, area: &Area, title_size: i32) -> Result<(), DrawError> {
        let (width, height) = area.dim_in_pixel();
        let middle = (MARGIN + Y_LABELS + width as i32) / 2;
        area.draw_text(self.title, &text(title_size, HPos::Center), (middle, TITLE_HEIGHT * 3 / 5))?;
        let (x, y) = (LogAxis::new(&self.x, width), LogAxis::new(&self.y, height));
        let mut chart = ChartBuilder::on(area)
            .margin_top(TITLE_HEIGHT)
            .margin_left(MARGIN)
            .margin_right(3 * MARGIN)
            .margin_bottom(MARGIN)
            .x_label_area_size(X_LABELS)
            .y_label_area_size(Y_LABELS)
            .build_cartesian_2d(x.clone(), y.clone())?;
        let mut mesh = chart.configure_mesh();
        house_style(&mut mesh);
        mesh.x_label_formatter(&|value| x.format_ext(value))
            .y_label_formatter(&|value| y.format_ext(value))
            .x_desc(self.x_label)
            .y_desc(self.y_label)
            .draw()?;
        for line in &self.lines {
            chart.draw_series(LineSeries::new(line.points.iter().copied(), line.stroke()))?;
        }
        let (left, top) = area.get_base_pixel();
        let in_area = |(x, y): (i32, i32)| (x - left, y - top);
        let placed: Vec<_> =
            self.points.iter().map(|point| (point, in_area(chart.backend_coord(&point.at)))).collect();
        draw_labels(area, &placed)?;
        for (point, at) in &placed {
            point.mark.draw(area, *at, point.color)?;
        }
        self.draw_legend(area, width as i32)
    }

    fn draw_legend(&self, area: &Area, area_width: i32) -> Result<(), DrawError> {
        let longest = self.legend.iter().map(|(_, label)| width(label)).max().unwrap_or(0);
        let left = area_width - 5 * MARGIN - longest - SAMPLE;
        for (row, (sample, label)) in self.legend.iter().enumerate() {
            sample.draw(area, (left, TITLE_HEIGHT + LEGEND_LINE + row as i32 * LEGEND_LINE), label)?;
        }
        Ok(())
    }
}

impl Sample {
    /// With its label to the right.
    fn draw(&self, area: &Area, (left, y): (i32, i32), label: &str) -> Result<(), DrawError> {
        match self {
            Self::Mark(mark, color) => mark.draw(area, (left + SAMPLE / 2, y), *color)?,
            Self::Line(style, width, color) => {
                let line = Line { points: vec![], style: *style, color: *color, width: *width };
                area.draw(&PathElement::new(vec![(left, y), (left + SAMPLE, y)], line.stroke()))?;
            }
        }
        area.draw_text(label, &text(12, HPos::Left), (left + SAMPLE + MARGIN, y))
    }
}

impl Line {
    fn stroke(&self) -> ShapeStyle {
        let color = palette(self.color);
        match (self.style, self.width) {
            (Stroke::Dashed, _) => rgb(DASHED_INK).stroke_width(15),
            (Stroke::Solid, Width::Band) => rgb(color).mix(0.35).stroke_width(60),
            (Stroke::Solid, Width::Curve) => rgb(color).stroke_width(20),
            (Stroke::Solid, Width::Hair) => rgb(color).mix(0.6).stroke_width(10),
        }
    }
}

impl Mark {
    fn draw(self, root: &Area, at: (i32, i32), color: usize) -> Result<(), DrawError> {
        let color = rgb(palette(color));
        match self {
            Self::Disc => root.draw(&Circle::new(at, RADIUS, color.filled())),
            Self::Ring => root.draw(&Circle::new(at, RADIUS - 6, color.stroke_width(15))),
        }
    }
}

/// Names and the thin lines that lead to them.
fn draw_labels(root: &Area, points: &[(&Point, (i32, i32))]) -> Result<(), DrawError> {
    let leader = |path| PathElement::new(path, rgb(GRID).mix(0.8).stroke_width(8));
    let by_label = |wanted: fn(&Label) -> bool| {
        points.iter().filter(move |(point, _)| wanted(&point.label)).map(|(point, at)| (point.label, *at))
    };

    // From the top down, none closer than a line to the one above.
    let mut left: Vec<_> = by_label(|label| matches!(label, Label::Left(_))).collect();
    left.sort_by_key(|(_, at)| at.1);
    let column = points.iter().map(|(_, (x, _))| *x - SIDESTEP).min().unwrap_or(0);
    let mut next = i32::MIN;
    for (label, (x, y)) in left {
        let Label::Left(name) = label else { continue };
        let height = y.max(next);
        next = height + LINE;
        root.draw(&leader(vec![(column, height), (column + SIDESTEP / 3, height), (x, y)]))?;
        root.draw_text(name, &text(12, HPos::Right), (column - 3 * UNIT, height))?;
    }

    // From right to left, each above the flags it would cover and those whose poles it would cross.
    let mut flags: Vec<_> = by_label(|label| matches!(label, Label::Flag(_))).collect();
    flags.sort_by_key(|(_, at)| -at.0);
    let mut flown: Vec<(i32, i32)> = vec![];
    for (label, (x, y)) in flags {
        let Label::Flag(name) = label else { continue };
        let end = x + width(name);
        let above = flown.iter().filter(|(start, _)| *start <= end).map(|(_, height)| height - LINE).min();
        let height = above.unwrap_or(i32::MAX).min(y - POLE);
        // A flag that is out of reach of those to the right starts low again.
        flown.retain(|(start, _)| *start <= end);
        flown.push((x, height));
        root.draw(&leader(vec![(x, y), (x, height - LINE / 3)]))?;
        root.draw_text(name, &text(12, HPos::Left), (x + 3 * UNIT, height))?;
    }
    Ok(())
}

/// Of a label, about.
pub(crate) fn width(label: &str) -> i32 {
    label.chars().count() as i32 * LETTER + 8 * UNIT
}

fn palette(color: usize) -> u32 {
    PALETTE.get(color % PALETTE.len()).copied().unwrap_or(INK)
}

/// Range and ticks of a logarithmic axis.
#[derive(Clone)]
struct LogAxis {
    range: Range<f64>,
    ticks: Vec<f64>,
}

impl LogAxis {
    /// Ticks at 1, 2 and 5 times the powers of ten where there is room, else at these, or every second one.
    fn new(range: &Range<f64>, length: u32) -> Self {
        let decade = f64::from(length) / (range.end / range.start).log10();
        let leads = if decade > ROOMY_DECADE { &[1.0, 2.0, 5.0][..] } else { &[1.0] };
        let (low, high) = (range.start.log10().floor() as i32, range.end.log10().ceil() as i32);
        let step = if high - low > 8 { 2 } else { 1 };
        let powers = (low..=high).filter(|power| power % step == 0);
        let ticks = powers.flat_map(|power| leads.iter().map(move |lead| lead * 10f64.powi(power)));
        let within = range.start * 0.999..range.end * 1.001;
        Self { range: range.clone(), ticks: ticks.filter(|tick| within.contains(tick)).collect() }
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
        let exponent = value.log10().round() as i32;
        if (1.0..1e5).contains(value) {
            format!("{value:.0}")
        } else if (value / 10f64.powi(exponent) - 1.0).abs() < 1e-9 {
            power_of_ten(exponent)
        } else {
            format!("{value}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tick_says_its_value() {
        let axis = LogAxis::new(&(0.05..2e5), 100_000);
        let written: Vec<_> = axis.ticks.iter().map(|tick| axis.format_ext(tick)).collect();
        assert_eq!(written.get(..5), Some(&["0.05", "10⁻¹", "0.2", "0.5", "1"].map(String::from)[..]));
        assert_eq!(written.get(18..), Some(&["50000", "10⁵", "200000"].map(String::from)[..]));
    }

    #[test]
    fn the_front_keeps_what_nothing_beats() {
        let points = [(3.0, 1.0), (1.0, 5.0), (2.0, 6.0), (4.0, 0.9)];
        assert_eq!(pareto_front(points.into_iter(), 0.8), [(1.0, 5.0), (3.0, 5.0), (3.0, 1.0)]);
    }
}
