//! Line charts as SVG files that stay readable on white and on dark pages.

use crate::output::axis::Axis;
use crate::output::svg::{
    Area, ChartError, DrawError, LABEL_SIZE, LEGEND_LINE, MARGIN, SAMPLE, TICK, UNIT, WIDTH, X_LABELS,
    Y_LABELS, dashed_on_top, draw_title, fitted_text, house_style, palette, text_width, title_height,
    write_picture,
};
use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use std::path::Path;

const PLOT_HEIGHT: i32 = 230 * UNIT;
const PANEL_GAP: i32 = 16 * UNIT;
/// From the plot to the samples of its legend.
const LEGEND_GAP: i32 = 14 * UNIT;
/// Most room for the labels of a legend; longer ones are written smaller.
const MAX_LABEL_WIDTH: i32 = 300 * UNIT;
const TITLE_SIZE: i32 = 15;

/// Most points drawn of one series, and of all together. The second bounds the size of the file.
const SERIES_POINTS: usize = 1500;
const CHART_POINTS: usize = 22_000;

/// Style of a line. Thin lines lie on solid ones, dashed lines on top, so all are seen where they coincide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineStyle {
    /// A measured signal.
    Solid,
    /// A commanded signal.
    Dashed,
    /// A bound of a signal, or one more signal.
    Thin,
}

/// One line of a panel.
#[derive(Debug, Clone, Copy)]
pub struct Series<'a> {
    /// Name in the legend. An empty one leaves the line out of it.
    pub label: &'a str,
    /// Points in drawing order. Those that are not finite are left out.
    pub points: &'a [(f64, f64)],
    /// Measured or commanded signal, or a bound of it.
    pub style: LineStyle,
    /// Index into the palette, which repeats after its last.
    pub color: usize,
}

impl Series<'_> {
    /// Points that can be drawn.
    pub fn finite(&self) -> impl Iterator<Item = (f64, f64)> {
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
        match self.style {
            LineStyle::Solid => palette(self.color).stroke_width(28),
            LineStyle::Dashed => dashed_on_top(self.color).stroke_width(15),
            LineStyle::Thin => palette(self.color).stroke_width(12),
        }
    }
}

/// One coordinate system. All panels of a chart share the x axis.
#[derive(Debug, Clone)]
pub struct Panel<'a> {
    /// Quantity and unit, such as `position [mm]`.
    pub y_label: &'a str,
    /// Lines of the panel; the range of the y axis covers them all.
    pub series: Vec<Series<'a>>,
}

/// Writes the panels, one below the other, as one SVG file.
///
/// The lines of the title after the first are a subtitle. The file appears complete or not at all.
pub fn write_svg(path: &Path, title: &str, x_label: &str, panels: &[Panel]) -> Result<(), ChartError> {
    let height = title_height(title) + panels.iter().map(Panel::height).sum::<i32>() + X_LABELS + MARGIN;
    write_picture(path, height, |root| draw(root, title, x_label, panels))
}

fn draw(root: &Area, title: &str, x_label: &str, panels: &[Panel]) -> Result<(), DrawError> {
    let series = || panels.iter().flat_map(|panel| &panel.series);
    let x_axis = Axis::new(x_label, series().flat_map(Series::finite).map(|(x, _)| x), 0.0, 10.0);
    let limit = SERIES_POINTS.min(CHART_POINTS / series().count().max(1)).max(2);
    let labels = panels.iter().flat_map(Panel::legend);
    let longest = labels.map(|series| text_width(series.label, LABEL_SIZE)).max();
    let longest = longest.map(|width| width.min(MAX_LABEL_WIDTH));
    let legend_width = longest.map_or(3 * MARGIN, |width| LEGEND_GAP + SAMPLE + width + 2 * MARGIN);

    draw_title(root, title, TITLE_SIZE)?;
    let (_, mut rest) = root.split_vertically(title_height(title));
    for (index, panel) in panels.iter().enumerate() {
        // Only the lowest panel shows the numbers and the label of the shared axis.
        let is_lowest = index + 1 == panels.len();
        let (area, below) = rest.split_vertically(panel.height() + if is_lowest { X_LABELS } else { 0 });
        let (plot, legend) = area.split_horizontally(WIDTH - legend_width);
        panel.draw_plot(&plot, &x_axis, is_lowest, limit)?;
        panel.draw_legend(&legend, longest.unwrap_or_default())?;
        rest = below;
    }
    Ok(())
}

impl Panel<'_> {
    fn legend(&self) -> impl Iterator<Item = &Series<'_>> {
        self.series.iter().filter(|series| !series.label.is_empty())
    }

    fn height(&self) -> i32 {
        PANEL_GAP + PLOT_HEIGHT.max(self.legend().count() as i32 * LEGEND_LINE)
    }

    fn draw_plot(&self, area: &Area, x: &Axis, is_lowest: bool, limit: usize) -> Result<(), DrawError> {
        let y =
            Axis::new(self.y_label, self.series.iter().flat_map(Series::finite).map(|(_, y)| y), 0.05, 8.0);
        let mut chart = ChartBuilder::on(area)
            .margin_top(PANEL_GAP)
            .margin_left(MARGIN)
            .x_label_area_size(if is_lowest { X_LABELS } else { TICK })
            .y_label_area_size(Y_LABELS)
            .build_cartesian_2d(x.clone(), y.clone())?;
        let mut mesh = chart.configure_mesh();
        let titles = [if is_lowest { x.title() } else { String::new() }, y.title()];
        let [x_title, y_title] = &titles;
        house_style(&mut mesh, [(x_title, WIDTH / 2), (y_title, PLOT_HEIGHT)]);
        mesh.x_label_formatter(&|value| if is_lowest { x.format_ext(value) } else { String::new() })
            .x_desc(x_title)
            .y_desc(y_title)
            .draw()?;
        for style in [LineStyle::Solid, LineStyle::Thin, LineStyle::Dashed] {
            for series in self.series.iter().filter(|series| series.style == style) {
                chart.draw_series(LineSeries::new(series.thinned(limit), series.stroke()))?;
            }
        }
        Ok(())
    }

    fn draw_legend(&self, area: &Area, room: i32) -> Result<(), DrawError> {
        for (row, series) in self.legend().enumerate() {
            let (x, y) = (LEGEND_GAP, PANEL_GAP + row as i32 * LEGEND_LINE + LEGEND_LINE / 2);
            area.draw(&PathElement::new(vec![(x, y), (x + SAMPLE, y)], series.stroke()))?;
            let label = fitted_text(&[(series.label, room)], LABEL_SIZE, HPos::Left);
            area.draw_text(series.label, &label, (x + SAMPLE + MARGIN, y))?;
        }
        Ok(())
    }
}
