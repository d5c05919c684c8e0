//! Drawing of the maps of a slice: one map per quantity with the limits of the reach, a legend, and home.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::bands::{MAX_BANDS, Quantity, distinct_texts};
use super::map_content::{LegendSample, MapLine, in_unit};
use super::slice::Slice;
use crate::output::axis::{Axis, displayed_exponent, prefixed};
use crate::output::svg::{
    Area, ChartError, DrawError, GRID, LABEL_SIZE, MARGIN, SAMPLE, TITLE_HEIGHT, UNIT, X_LABELS, Y_LABELS,
    draw_title, fitted_text, house_style, legend_rows, rgb, text, write_picture,
};
use hexad_core::model::machine::Machine;

/// Height of one map with its title and its axis.
const CELL_HEIGHT: i32 = 350 * UNIT;
/// Width of the colour scale right of a map, and of its numbers.
const BAR_WIDTH: i32 = 14 * UNIT;
const BAR_LABEL_WIDTH: i32 = 56 * UNIT;
/// Approximate number of ticks on an axis.
const TICK_COUNT: f64 = 6.0;
/// Radius of the mark of home.
const HOME_RADIUS: i32 = 5 * UNIT;

/// Colours from bad to good: viridis (S. van der Walt, N. Smith). They keep their order in grey and for
/// colour-blind readers.
const COLORS: [u32; MAX_BANDS] = [
    0x44_0154, 0x48_2878, 0x3E_4989, 0x31_688E, 0x26_828E, 0x1F_9E89, 0x35_B779, 0x6D_CD59, 0xB4_DE2C,
    0xFD_E725,
];
/// Colour of poses in reach but beyond a limit of the machine, visible on light and dark pages.
const BEYOND_LIMIT: u32 = GRID;

/// Values shared by all map drawings of a machine.
pub struct MapDrawing<'a> {
    pub name: &'a str,
    pub machine: &'a Machine,
    pub largest_condition: f64,
    /// Radius of the ball proved free of obstacles at home's orientation \[m\].
    pub ball: f64,
}

impl MapDrawing<'_> {
    /// Writes the maps of a slice as one SVG file, complete or not at all.
    pub fn write_svg(&self, path: &Path, slice: &Slice) -> Result<(), ChartError> {
        let title = format!("{}: workspace, {} through {}", self.name, slice.plane, self.place(slice));
        let lines = self.lines(slice);
        let mut samples: Vec<_> = lines.iter().map(|(sample, _)| *sample).collect();
        samples.dedup_by_key(|(_, label)| *label);
        samples.push((rgb(BEYOND_LIMIT).mix(0.4).stroke_width(100), "beyond a limit"));
        let labels = samples.iter().map(|(_, label)| *label).chain(["home"]);
        let (positions, legend_height) = legend_rows(labels);
        write_picture(path, TITLE_HEIGHT + legend_height + 2 * CELL_HEIGHT, |root| {
            draw_title(root, &title, 15)?;
            let (_, rest) = root.split_vertically(TITLE_HEIGHT);
            draw_legend(&rest, &samples, &positions, slice.through == self.machine.home)?;
            let (_, cells) = rest.split_vertically(legend_height);
            let cells = cells.split_evenly((2, 2));
            cells
                .iter()
                .zip(self.quantities(slice))
                .try_for_each(|(cell, of)| self.draw_map(cell, slice, &of, &lines))
        })
    }

    fn draw_map(
        &self,
        area: &Area,
        slice: &Slice,
        quantity: &Quantity,
        lines: &[MapLine],
    ) -> Result<(), DrawError> {
        let right = BAR_WIDTH + BAR_LABEL_WIDTH + 2 * MARGIN;
        let (width, height) = area.dim_in_pixel();
        let middle = (MARGIN + Y_LABELS + width as i32 - right) / 2;
        let thresholds = quantity.thresholds(slice.qualities.iter().filter(|quality| quality.within_reach()));
        let exponent = displayed_exponent(quantity.label, thresholds.iter().copied().fold(0.0, f64::max));
        let title = prefixed(quantity.label, exponent);
        let label = fitted_text(&[(&title, width as i32)], 13, HPos::Center);
        area.draw_text(&title, &label, (middle, TITLE_HEIGHT * 3 / 5))?;
        let room = [
            f64::from(width as i32 - MARGIN - Y_LABELS - right),
            f64::from(height as i32 - TITLE_HEIGHT - X_LABELS - MARGIN),
        ];
        let [x, y] = axes(slice, room);
        let mut chart = ChartBuilder::on(area)
            .margin_top(TITLE_HEIGHT)
            .margin_left(MARGIN)
            .margin_right(right)
            .margin_bottom(MARGIN)
            .x_label_area_size(X_LABELS)
            .y_label_area_size(Y_LABELS)
            .build_cartesian_2d(x.clone(), y.clone())?;
        let mut mesh = chart.configure_mesh();
        let [x_label, y_label] = [x.title(), y.title()];
        house_style(&mut mesh, [(&x_label, width as i32 - Y_LABELS), (&y_label, CELL_HEIGHT - X_LABELS)]);
        mesh.x_desc(x_label).y_desc(y_label).draw()?;

        let beyond = rgb(BEYOND_LIMIT).mix(0.4).filled();
        let bands: Vec<_> = thresholds.iter().zip(colors(thresholds.len())).collect();
        let reach = (f64::NAN, beyond);
        let colored = bands.iter().map(|(threshold, color)| (**threshold, rgb(*color).filled()));
        for (threshold, style) in [reach].into_iter().chain(colored) {
            let polygon = self.polygon(slice, quantity, threshold);
            chart.draw_series([Polygon::new(polygon, style)])?;
        }
        for ((style, _), line) in lines {
            chart.draw_series(visible(line.clone(), *style))?;
        }
        let (left, top) = area.get_base_pixel();
        let in_area = |(x, y): (i32, i32)| (x - left, y - top);
        let place = slice.plane.0.map(|axis| self.machine.home.get(axis).copied().unwrap_or_default());
        let home = in_area(chart.backend_coord(&in_unit(slice, place)));
        let (xs, ys) = chart.plotting_area().get_pixel_range();
        let [(start, top), (end, bottom)] = [(xs.start, ys.start), (xs.end, ys.end)].map(in_area);
        if (start..end).contains(&home.0) && (top..bottom).contains(&home.1) {
            draw_home(area, home, slice.through == self.machine.home)?;
        }
        let scaled: Vec<_> = thresholds.iter().map(|threshold| threshold / 10f64.powi(exponent)).collect();
        let labels = distinct_texts(&scaled);
        let colors: Vec<_> = labels.iter().zip(colors(labels.len())).collect();
        draw_bar(area, (end + 2 * MARGIN, top, bottom), &colors)
    }
}

/// Name and unit of an axis, such as `x [m]`.
fn axis_label(axis: usize) -> &'static str {
    let names = ["alpha [deg]", "beta [deg]", "gamma [deg]", "x [m]", "y [m]", "z [m]"];
    names.get(axis).copied().unwrap_or_default()
}

/// Both axes, with equal scales if they have the same unit.
fn axes(slice: &Slice, room: [f64; 2]) -> [Axis; 2] {
    let [(left, right), (bottom, top)] = slice.ranges;
    let (low, high) = (in_unit(slice, [left, bottom]), in_unit(slice, [right, top]));
    let [first, second] = slice.plane.0;
    let [right, up] = slice.plane.0.map(axis_label);
    if (first < 3) == (second < 3) {
        return Axis::with_equal_scales([right, up], &[low, high], 0.0, room, TICK_COUNT);
    }
    [(right, low.0, high.0), (up, low.1, high.1)]
        .map(|(label, low, high)| Axis::new(label, [low, high].into_iter(), 0.0, TICK_COUNT))
}

/// Given number of colours, from bad to good.
fn colors(count: usize) -> impl Iterator<Item = u32> {
    let last = count.max(2) - 1;
    (0..count).filter_map(move |k| COLORS.get(k * (MAX_BANDS - 1) / last).copied())
}

/// A line visible on any colour: a white one gets a dark outline.
fn visible(line: Vec<(f64, f64)>, style: ShapeStyle) -> Vec<PathElement<(f64, f64)>> {
    let under =
        (style.color == WHITE.to_rgba()).then(|| PathElement::new(line.clone(), BLACK.stroke_width(32)));
    under.into_iter().chain([PathElement::new(line, style)]).collect()
}

fn draw_line(area: &Area, line: Vec<(i32, i32)>, style: ShapeStyle) -> Result<(), DrawError> {
    if style.color == WHITE.to_rgba() {
        area.draw(&PathElement::new(line.clone(), BLACK.stroke_width(32)))?;
    }
    area.draw(&PathElement::new(line, style))
}

/// Draws the legend. The last position belongs to the mark of home.
fn draw_legend(
    area: &Area,
    samples: &[LegendSample],
    positions: &[(i32, i32)],
    through_home: bool,
) -> Result<(), DrawError> {
    let draw_label = |label: &str, (left, y): (i32, i32)| {
        area.draw_text(label, &text(LABEL_SIZE, HPos::Left), (left + SAMPLE + MARGIN, y))
    };
    for ((style, label), (left, y)) in samples.iter().zip(positions) {
        draw_line(area, vec![(*left, *y), (left + SAMPLE, *y)], *style)?;
        draw_label(label, (*left, *y))?;
    }
    let Some((left, y)) = positions.last() else { return Ok(()) };
    draw_home(area, (left + SAMPLE / 2, *y), through_home)?;
    draw_label("home", (*left, *y))
}

/// Mark of home: a disc if the slice contains home, a ring if home is in front of it or behind it.
fn draw_home(area: &Area, at: (i32, i32), on_slice: bool) -> Result<(), DrawError> {
    area.draw(&Circle::new(at, HOME_RADIUS, BLACK.stroke_width(32)))?;
    if on_slice {
        area.draw(&Circle::new(at, HOME_RADIUS, BLACK.filled()))?;
    }
    area.draw(&Circle::new(at, HOME_RADIUS, WHITE.stroke_width(15)))
}

/// Colour scale with the thresholds between the colours, the best on top.
fn draw_bar(
    area: &Area,
    (left, top, bottom): (i32, i32, i32),
    bands: &[(&String, u32)],
) -> Result<(), DrawError> {
    let height = |k: usize| bottom - (bottom - top) * k as i32 / bands.len().max(1) as i32;
    let rooms: Vec<_> = bands.iter().map(|(label, _)| (label.as_str(), BAR_LABEL_WIDTH)).collect();
    let style = fitted_text(&rooms, LABEL_SIZE, HPos::Left);
    for (k, (label, color)) in bands.iter().enumerate() {
        let corners = [(left, height(k + 1)), (left + BAR_WIDTH, height(k))];
        area.draw(&Rectangle::new(corners, rgb(*color).filled()))?;
        area.draw_text(label, &style, (left + BAR_WIDTH + MARGIN, height(k)))?;
    }
    Ok(())
}
