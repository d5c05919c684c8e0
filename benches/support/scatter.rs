//! Points and lines on logarithmic axes, one chart or a grid of them, in the style of [`hexad::output::charts`].

use std::ops::Range;
use std::path::Path;

use hexad::output::charts::LineStyle;
use hexad::output::svg::{
    Area, ChartError, DASHED_INK, DrawError, GRID, LABEL_SIZE, MARGIN, SAMPLE, TITLE_HEIGHT, UNIT, X_LABELS,
    Y_LABELS, draw_title, house_style, legend_rows, palette, rgb, text, text_width, title_height,
    write_picture,
};
use plotters::coord::ranged1d::ValueFormatter as _;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::log_axis::{LogAxis, NUMBER_GAP, log_range};

/// Height of a chart over the whole width, and of one beside others.
const WIDE_HEIGHT: i32 = 520 * UNIT;
const CELL_HEIGHT: i32 = 260 * UNIT;
const RADIUS: i32 = 45;
/// Height of a line of labels.
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
    pub style: LineStyle,
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

/// One chart.
#[derive(Debug, Clone, Default)]
pub struct Scatter<'a> {
    /// None if empty.
    pub title: &'a str,
    pub x_label: &'a str,
    pub y_label: &'a str,
    /// Ranges of the axes, see [`log_range`].
    pub x: Range<f64>,
    pub y: Range<f64>,
    pub points: Vec<Point<'a>>,
    pub lines: Vec<Line>,
}

impl Scatter<'_> {
    /// Positions of everything drawn.
    fn positions(&self) -> impl Iterator<Item = (f64, f64)> {
        let lines = self.lines.iter().flat_map(|line| &line.points).copied();
        self.points.iter().map(|point| point.at).chain(lines)
    }
}

/// Sets the ranges of charts to what they draw: of each x axis its own or, like the y axis, the same for all.
pub fn fit_ranges(charts: &mut [Scatter], shares_x: bool) {
    let of_all = |coordinate: fn((f64, f64)) -> f64| {
        log_range(charts.iter().flat_map(Scatter::positions).map(coordinate))
    };
    let (x, y) = (of_all(|at| at.0), of_all(|at| at.1));
    for chart in charts {
        let own = log_range(chart.positions().map(|at| at.0));
        (chart.x, chart.y) = (if shares_x { x.clone() } else { own }, y.clone());
    }
}

/// A mark or a line in the legend.
#[derive(Debug, Clone)]
pub enum Sample {
    Mark(Mark, usize),
    Line(LineStyle, Width, usize),
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
    /// The lines after the first are a subtitle.
    pub title: &'a str,
    /// What the marks and the lines mean.
    pub legend: Vec<(Sample, &'a str)>,
    pub columns: usize,
    /// Row by row.
    pub charts: Vec<Scatter<'a>>,
}

impl Grid<'_> {
    /// Writes the charts as one SVG file, complete or not at all.
    pub fn write_svg(&self, path: &Path) -> Result<(), ChartError> {
        let rows = self.charts.len().div_ceil(self.columns.max(1));
        let (entries, legend_height) = legend_rows(self.legend.iter().map(|(_, label)| *label));
        let head = title_height(self.title);
        let cell_height = if self.columns > 1 { CELL_HEIGHT } else { WIDE_HEIGHT };
        write_picture(path, head + legend_height + rows as i32 * cell_height, |root| {
            draw_title(root, self.title, 15)?;
            let (_, rest) = root.split_vertically(head);
            for ((sample, label), at) in self.legend.iter().zip(entries) {
                sample.draw(&rest, at, label)?;
            }
            let (_, cells) = rest.split_vertically(legend_height);
            let cells = cells.split_evenly((rows, self.columns));
            self.charts.iter().zip(&cells).try_for_each(|(chart, cell)| chart.draw_in(cell))
        })
    }
}

impl Scatter<'_> {
    fn draw_in(&self, area: &Area) -> Result<(), DrawError> {
        draw_title(area, self.title, 13)?;
        let head = if self.title.is_empty() { 2 * MARGIN } else { TITLE_HEIGHT };
        let (width, height) = area.dim_in_pixel();
        let (width, height) =
            (width as i32 - Y_LABELS - 4 * MARGIN, height as i32 - X_LABELS - head - MARGIN);
        let number_width = |number: &str| text_width(number, LABEL_SIZE) + NUMBER_GAP;
        let x = LogAxis::new(&self.x, width, number_width);
        let y = LogAxis::new(&self.y, height, |_| LABEL_SIZE * UNIT + NUMBER_GAP);
        let mut chart = ChartBuilder::on(area)
            .margin_top(head)
            .margin_left(MARGIN)
            .margin_right(3 * MARGIN)
            .margin_bottom(MARGIN)
            .x_label_area_size(X_LABELS)
            .y_label_area_size(Y_LABELS)
            .build_cartesian_2d(x.clone(), y.clone())?;
        let mut mesh = chart.configure_mesh();
        house_style(&mut mesh, [(self.x_label, width), (self.y_label, height)]);
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
        placed.iter().try_for_each(|(point, at)| point.mark.draw(area, *at, point.color))
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
        area.draw_text(label, &text(LABEL_SIZE, HPos::Left), (left + SAMPLE + MARGIN, y))
    }
}

impl Line {
    fn stroke(&self) -> ShapeStyle {
        let color = palette(self.color);
        match (self.style, self.width) {
            (LineStyle::Dashed, _) => rgb(DASHED_INK).stroke_width(15),
            (LineStyle::Solid | LineStyle::Thin, Width::Band) => color.mix(0.35).stroke_width(60),
            (LineStyle::Solid | LineStyle::Thin, Width::Curve) => color.stroke_width(20),
            (LineStyle::Solid | LineStyle::Thin, Width::Hair) => color.mix(0.6).stroke_width(10),
        }
    }
}

impl Mark {
    fn draw(self, root: &Area, at: (i32, i32), color: usize) -> Result<(), DrawError> {
        let color = palette(color);
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
        root.draw_text(name, &text(LABEL_SIZE, HPos::Right), (column - 3 * UNIT, height))?;
    }

    // From right to left, each above the flags it would cover and those whose poles it would cross.
    let mut flags: Vec<_> = by_label(|label| matches!(label, Label::Flag(_))).collect();
    flags.sort_by_key(|(_, at)| -at.0);
    let mut flown: Vec<(i32, i32)> = vec![];
    for (label, (x, y)) in flags {
        let Label::Flag(name) = label else { continue };
        let end = x + text_width(name, LABEL_SIZE);
        let above = flown.iter().filter(|(start, _)| *start <= end).map(|(_, height)| height - LINE).min();
        let height = above.unwrap_or(i32::MAX).min(y - POLE);
        // A flag that is out of reach of those to the right starts low again.
        flown.retain(|(start, _)| *start <= end);
        flown.push((x, height));
        root.draw(&leader(vec![(x, y), (x, height - LINE / 3)]))?;
        root.draw_text(name, &text(LABEL_SIZE, HPos::Left), (x + 3 * UNIT, height))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_front_keeps_what_nothing_beats() {
        let points = [(3.0, 1.0), (1.0, 5.0), (2.0, 6.0), (4.0, 0.9)];
        assert_eq!(super::pareto_front(points.into_iter(), 0.8), [(1.0, 5.0), (3.0, 5.0), (3.0, 1.0)]);
    }
}
