//! Line charts as SVG files that stay readable on white and on dark pages.

use super::files::{FileError, write_whole};
use core::ops::Range;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::io;
use std::path::Path;

/// Drawing units per pixel. The backend knows whole units only, and whole pixels would draw stairs.
pub(crate) const UNIT: i32 = 10;
pub(crate) const WIDTH: i32 = 900 * UNIT;
pub(crate) const TITLE_HEIGHT: i32 = 28 * UNIT;
const PLOT_HEIGHT: i32 = 230 * UNIT;
const PANEL_GAP: i32 = 16 * UNIT;
pub(crate) const TICK: i32 = 4 * UNIT;
pub(crate) const MARGIN: i32 = 6 * UNIT;
pub(crate) const X_LABELS: i32 = 42 * UNIT;
pub(crate) const Y_LABELS: i32 = 78 * UNIT;
pub(crate) const LEGEND_LINE: i32 = 19 * UNIT;
pub(crate) const SAMPLE: i32 = 26 * UNIT;

/// Most points drawn of one series, and of all together. The second bounds the size of the file.
const SERIES_POINTS: usize = 1500;
const CHART_POINTS: usize = 22_000;

/// Six legs. These have a contrast of at least 3:1 on white as well as on a dark page, because not every
/// viewer tells the image which of the two it lies on. They differ in lightness too, for colour-blind
/// readers.
pub(crate) const PALETTE: [u32; 6] = [0x0A6FD6, 0xB98A00, 0x008573, 0xC8430F, 0x4897E0, 0xC77BA8];
pub(crate) const INK: u32 = 0x59636E;
const INK_ON_DARK: u32 = 0xB1BAC4;
/// Dashed lines that lie on no other one; readable on both pages as it is.
pub(crate) const DASHED_INK: u32 = 0x6E7781;
pub(crate) const GRID: u32 = 0x8B949E;

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type DrawError = DrawingAreaErrorKind<io::Error>;

/// Why a chart was not written.
#[derive(Debug, thiserror::Error)]
pub enum ChartError {
    #[error("cannot draw the chart: {0}")]
    Draw(#[from] DrawError),
    #[error("cannot write the chart: {0}")]
    Write(#[from] FileError),
}

/// How a line is drawn. Dashed lines lie on top, so both are seen where they coincide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// A measured signal.
    Solid,
    /// A commanded signal.
    Dashed,
}

/// One line of a panel.
#[derive(Debug, Clone, Copy)]
pub struct Series<'a> {
    /// Name in the legend. An empty one leaves the line out of it.
    pub label: &'a str,
    /// Points in drawing order. Those that are not finite are left out.
    pub points: &'a [(f64, f64)],
    pub style: Stroke,
    /// Index into the palette, which repeats after six.
    pub color: usize,
}

impl Series<'_> {
    fn finite(&self) -> impl Iterator<Item = (f64, f64)> {
        // The bound also keeps differences of two values finite.
        self.points.iter().copied().filter(|(x, y)| x.abs() < 1e100 && y.abs() < 1e100)
    }

    /// Keeps the lowest and the highest point of each stretch, so no peak is lost.
    fn thinned(&self, limit: usize) -> Vec<(f64, f64)> {
        let points: Vec<_> = self.finite().collect();
        if points.len() <= limit {
            return points;
        }
        let extremes = points.chunks(points.len().div_ceil(limit / 2)).flat_map(|stretch| {
            let low = stretch.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            let high = stretch.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            // Points compare by x first.
            if low <= high { [low, high] } else { [high, low] }.into_iter().flatten()
        });
        points.first().into_iter().chain(extremes).chain(points.last()).copied().collect()
    }

    fn stroke(&self) -> ShapeStyle {
        let color = PALETTE.get(self.color % PALETTE.len()).copied().unwrap_or(INK);
        match self.style {
            Stroke::Solid => rgb(color).stroke_width(28),
            Stroke::Dashed => rgb(commanded(color)).stroke_width(15),
        }
    }
}

/// One coordinate system. All panels of a chart share the x axis.
#[derive(Debug, Clone)]
pub struct Panel<'a> {
    /// Quantity and unit, such as `position [mm]`.
    pub y_label: &'a str,
    pub series: Vec<Series<'a>>,
}

/// Writes the panels, one below the other, as one SVG file.
///
/// The file appears complete or not at all.
pub fn write_svg(path: &Path, title: &str, x_label: &str, panels: &[Panel]) -> Result<(), ChartError> {
    Ok(write_whole(path, draw(title, x_label, panels)?.as_bytes())?)
}

/// Axes, grid and labels as in every chart.
pub(crate) fn house_style<'a, X, Y, DB: DrawingBackend>(
    mesh: &mut plotters::chart::MeshStyle<'a, '_, X, Y, DB>,
) where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    mesh.axis_style(rgb(INK).stroke_width(10))
        .bold_line_style(rgb(GRID).mix(0.3).stroke_width(10))
        .set_all_tick_mark_size(TICK)
        .label_style(text(12, HPos::Center))
        .axis_desc_style(text(13, HPos::Center));
}

fn draw(title: &str, x_label: &str, panels: &[Panel]) -> Result<String, DrawError> {
    let series = || panels.iter().flat_map(|panel| &panel.series);
    let x_axis = Axis::new(series().flat_map(Series::finite).map(|(x, _)| x), 0.0, 10.0);
    let limit = SERIES_POINTS.min(CHART_POINTS / series().count().max(1)).max(2);
    let longest = series().map(|series| series.label.chars().count()).max().unwrap_or(0);
    let legend_width = SAMPLE + (24 + 7 * longest.min(32) as i32) * UNIT;

    let height = TITLE_HEIGHT + panels.iter().map(Panel::height).sum::<i32>() + X_LABELS + MARGIN;
    let mut svg = String::new();
    {
        let size = (WIDTH.unsigned_abs(), height.unsigned_abs());
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let middle = (MARGIN + Y_LABELS + WIDTH - legend_width) / 2;
        root.draw_text(title, &text(15, HPos::Center), (middle, TITLE_HEIGHT * 3 / 5))?;

        let (_, mut rest) = root.split_vertically(TITLE_HEIGHT);
        for (index, panel) in panels.iter().enumerate() {
            // Only the lowest panel shows the numbers and the label of the shared axis.
            let x_label = (index + 1 == panels.len()).then_some(x_label);
            let (area, below) = rest.split_vertically(panel.height() + x_label.map_or(0, |_| X_LABELS));
            let (plot, legend) = area.split_horizontally(WIDTH - legend_width);
            panel.draw_plot(&plot, &x_axis, x_label, limit)?;
            panel.draw_legend(&legend)?;
            rest = below;
        }
        root.present()?;
    }
    Ok(finish(&svg, height))
}

impl Panel<'_> {
    fn legend(&self) -> impl Iterator<Item = &Series<'_>> {
        self.series.iter().filter(|series| !series.label.is_empty())
    }

    fn height(&self) -> i32 {
        PANEL_GAP + PLOT_HEIGHT.max(self.legend().count() as i32 * LEGEND_LINE)
    }

    fn draw_plot(&self, area: &Area, x: &Axis, x_label: Option<&str>, limit: usize) -> Result<(), DrawError> {
        let y = Axis::new(self.series.iter().flat_map(Series::finite).map(|(_, y)| y), 0.05, 8.0);
        let mut chart = ChartBuilder::on(area)
            .margin_top(PANEL_GAP)
            .margin_left(MARGIN)
            .x_label_area_size(x_label.map_or(TICK, |_| X_LABELS))
            .y_label_area_size(Y_LABELS)
            .build_cartesian_2d(x.clone(), y.clone())?;
        let mut mesh = chart.configure_mesh();
        house_style(&mut mesh);
        mesh.x_label_formatter(&|value| x_label.map_or(String::new(), |_| x.format_ext(value)))
            .x_desc(x_label.map_or(String::new(), |label| x.label(label)))
            .y_desc(y.label(self.y_label))
            .draw()?;
        for style in [Stroke::Solid, Stroke::Dashed] {
            for series in self.series.iter().filter(|series| series.style == style) {
                chart.draw_series(LineSeries::new(series.thinned(limit), series.stroke()))?;
            }
        }
        Ok(())
    }

    fn draw_legend(&self, area: &Area) -> Result<(), DrawError> {
        let label = text(12, HPos::Left);
        for (row, series) in self.legend().enumerate() {
            let (x, y) = (14 * UNIT, PANEL_GAP + row as i32 * LEGEND_LINE + LEGEND_LINE / 2);
            area.draw(&PathElement::new(vec![(x, y), (x + SAMPLE, y)], series.stroke()))?;
            area.draw_text(series.label, &label, (x + SAMPLE + 6 * UNIT, y))?;
        }
        Ok(())
    }
}

/// Range and ticks of one axis.
#[derive(Clone)]
pub(crate) struct Axis {
    low: f64,
    high: f64,
    ticks: Vec<f64>,
    /// Power of ten taken out of the numbers and put beside the unit.
    exponent: i32,
    decimals: usize,
}

impl Axis {
    /// Covers the values and a `margin` as a share of their span, with about `count` ticks at most.
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

    /// Turns `position [mm]` into `position [10⁻⁶ mm]` where the numbers need it.
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

/// `10⁻⁶`
pub(crate) fn power_of_ten(exponent: i32) -> String {
    let raised = |digit: u32| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize);
    let digits = format!("{exponent}");
    let power: String = digits.chars().map(|c| c.to_digit(10).and_then(raised).unwrap_or('⁻')).collect();
    format!("10{power}")
}

pub(crate) fn rgb(color: u32) -> RGBColor {
    let [_, red, green, blue] = color.to_be_bytes();
    RGBColor(red, green, blue)
}

/// A commanded line has a quarter of the brightness of the measured one. So it shows on top of it.
fn commanded(color: u32) -> u32 {
    (color >> 2) & 0x3F_3F3F
}

pub(crate) fn text(size: i32, anchor: HPos) -> TextStyle<'static> {
    // The backend divides by the line height.
    let size = f64::from(size * UNIT) * 1.24;
    ("sans-serif", size).into_font().color(&rgb(INK)).pos(Pos::new(anchor, VPos::Center))
}

const DASH: &str = "stroke-dasharray:60 50";

/// Scales units to pixels, and adds the style that the backend cannot express.
pub(crate) fn finish(svg: &str, height: i32) -> String {
    let rule = |part: &str, of: u32, rule: &str| format!("[{part}=\"#{of:06X}\"]{{{rule}}}");
    let paint = |part: &str, from: u32, to: u32| rule(part, from, &format!("{part}:#{to:06X}"));
    let mut style =
        String::from("text{font-family:Helvetica,Arial,sans-serif}polyline{stroke-linejoin:round}");
    style += &rule("stroke", DASHED_INK, DASH);
    let mut dark = paint("fill", INK, INK_ON_DARK) + &paint("stroke", INK, INK_ON_DARK);
    for color in PALETTE {
        let line = commanded(color);
        style += &rule("stroke", line, DASH);
        // Dark shades would vanish here, so they become light ones.
        dark += &paint("stroke", line, line + 0xC0_C0C0);
    }
    let style = format!(">\n<style>{style}\n@media (prefers-color-scheme:dark){{{dark}}}</style>\n");
    let size = |unit: i32| format!("width=\"{}\" height=\"{}\"", WIDTH / unit, height / unit);
    svg.replacen(&size(1), &size(UNIT), 1).replacen(">\n", &style, 1)
}
