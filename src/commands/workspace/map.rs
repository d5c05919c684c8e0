//! Pictures of a slice: a map of each quantity, where reach ends and why, home.

use core::f64::consts::TAU;
use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::bands::{BANDS, Better, Quantity, plain};
use super::contour::{Corner, outlines};
use super::slice::Slice;
use crate::analysis::pose_quality::PoseQuality;
use crate::model::machine::Machine;
use crate::output::axis::Axis;
use crate::output::svg::{
    Area, ChartError, DASHED_INK, DrawError, GRID, INK, LABEL_SIZE, MARGIN, SAMPLE, TITLE_HEIGHT, UNIT,
    X_LABELS, Y_LABELS, draw_title, fitted_text, house_style, legend_rows, rgb, text, write_picture,
};

/// Height of one map with its title and its axis.
const CELL_HEIGHT: i32 = 350 * UNIT;
/// The scale of colours, right of a map: its width, and room for its numbers.
const BAR: i32 = 14 * UNIT;
const BAR_LABELS: i32 = 56 * UNIT;
/// About as many ticks on an axis.
const TICKS: f64 = 6.0;
/// Forces beyond the actuators' limit everywhere have colours up to this many times the least.
const FAR: f64 = 5.0;
const DISC: i32 = 5 * UNIT;

/// From bad to good: viridis (S. van der Walt, N. Smith), which keeps its order in grey and for the colour-blind.
const COLORS: [u32; BANDS] = [
    0x44_0154, 0x48_2878, 0x3E_4989, 0x31_688E, 0x26_828E, 0x1F_9E89, 0x35_B779, 0x6D_CD59, 0xB4_DE2C,
    0xFD_E725,
];
/// Of what is in reach, but beyond a limit of the machine; seen on both pages.
const BEYOND: u32 = GRID;
/// Where a singular pose ends the reach.
const SINGULAR: u32 = 0xC8_430F;

/// What all pictures of a machine have in common.
pub struct Maps<'a> {
    pub name: &'a str,
    pub machine: &'a Machine,
    pub largest_condition: f64,
    /// Radius of the ball that is proved clear at home's orientation \[m\].
    pub ball: f64,
}

/// What goes with a line in the legend.
type Sample = (ShapeStyle, &'static str);

impl Maps<'_> {
    /// Writes the maps of a slice as one SVG file, complete or not at all.
    pub fn write_svg(&self, path: &Path, slice: &Slice) -> Result<(), ChartError> {
        let title = format!("{}: workspace, {} through {}", self.name, slice.plane, self.place(slice));
        let lines = self.lines(slice);
        let mut samples: Vec<Sample> = lines.iter().map(|(sample, _)| *sample).collect();
        samples.dedup_by_key(|(_, label)| *label);
        samples.push((rgb(BEYOND).mix(0.4).stroke_width(100), "beyond a limit"));
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

    fn quantities(&self, slice: &Slice) -> [Quantity; 4] {
        let max_force = self.machine.actuator.max_force;
        let reached = || slice.qualities.iter().filter(|quality| quality.within_reach());
        // Where every pose asks for more than the actuators have, the map still says how much.
        let some = reached().any(|quality| quality.worst_force <= max_force);
        let (force_label, payload_label, max_force) = if some {
            ("worst force [N]", "payload [kg]", max_force)
        } else {
            let least = reached().map(|quality| quality.worst_force).fold(f64::INFINITY, f64::min);
            ("worst force [N], nowhere within the limit", "payload [kg]: none anywhere", FAR * least)
        };
        [
            Quantity {
                label: "stroke margin [mm]",
                value: |quality| 1e3 * quality.stroke_margin,
                better: Better::Higher,
                worst: 0.0,
                max_force: f64::INFINITY,
            },
            Quantity {
                label: "condition",
                value: |quality| quality.condition,
                better: Better::Lower,
                worst: self.largest_condition,
                max_force: f64::INFINITY,
            },
            Quantity {
                label: force_label,
                value: |quality| quality.worst_force,
                better: Better::Lower,
                worst: max_force,
                max_force,
            },
            Quantity {
                label: payload_label,
                value: |quality| quality.payload,
                better: Better::Higher,
                // Nothing is what is beyond. It is the same for all poses there: only the forces say where it begins.
                worst: f64::MIN_POSITIVE,
                max_force,
            },
        ]
    }

    /// The pose in words.
    fn place(&self, slice: &Slice) -> String {
        if slice.through == self.machine.home {
            return "home".into();
        }
        let [a, b, c, x, y, z] = slice.through;
        let [a, b, c] = [a, b, c].map(|angle| plain(angle.to_degrees()));
        let [x, y, z] = [x, y, z].map(plain);
        format!("{a}, {b}, {c} deg, {x}, {y}, {z} m")
    }

    /// What is drawn over the colours, in the units of the axes.
    fn lines(&self, slice: &Slice) -> Vec<(Sample, Vec<(f64, f64)>)> {
        let edge = |quality: &PoseQuality| [quality.stroke_margin, quality.determinant];
        let reach = outlines(slice.count, |places| slice.at(places).map(edge));
        let limit = |quality: &PoseQuality| {
            [quality.stroke_margin, quality.determinant, self.largest_condition - quality.condition]
        };
        let limited = outlines(slice.count, |places| slice.at(places).map(limit));
        let kinds = [
            (&reach, 0, (rgb(INK).stroke_width(18), "end of stroke")),
            (&reach, 1, (rgb(SINGULAR).stroke_width(25), "singular poses")),
            (&limited, 2, (rgb(DASHED_INK).stroke_width(18), "limit of the condition")),
        ];
        let mut lines = vec![];
        for (outlines, cause, sample) in kinds {
            let parts = outlines.iter().flat_map(|outline| caused(outline, cause));
            lines.extend(parts.map(|part| (sample, part.into_iter().map(|at| shown(slice, at)).collect())));
        }
        if self.has_ball(slice) {
            let [x, y] = slice.plane.0.map(|axis| self.machine.home.get(axis).copied().unwrap_or_default());
            let angles = (0..=90).map(|k| f64::from(k) * TAU / 90.0);
            let circle: Vec<_> = angles.map(|a| (x + self.ball * a.cos(), y + self.ball * a.sin())).collect();
            lines.push(((WHITE.stroke_width(15), "ball without obstacle"), circle));
        }
        lines
    }

    /// Whether the slice cuts the ball through its middle.
    fn has_ball(&self, slice: &Slice) -> bool {
        slice.through == self.machine.home && slice.plane.0.iter().all(|axis| *axis >= 3)
    }

    fn draw_map(
        &self,
        area: &Area,
        slice: &Slice,
        quantity: &Quantity,
        lines: &[(Sample, Vec<(f64, f64)>)],
    ) -> Result<(), DrawError> {
        let right = BAR + BAR_LABELS + 2 * MARGIN;
        let (width, height) = area.dim_in_pixel();
        let middle = (MARGIN + Y_LABELS + width as i32 - right) / 2;
        let label = fitted_text(&[(quantity.label, width as i32)], 13, HPos::Center);
        area.draw_text(quantity.label, &label, (middle, TITLE_HEIGHT * 3 / 5))?;
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
        let [x_label, y_label] = slice.plane.0.map(axis_label);
        let [x_label, y_label] = [x.label(&x_label), y.label(&y_label)];
        house_style(&mut mesh, [(&x_label, width as i32 - Y_LABELS), (&y_label, CELL_HEIGHT - X_LABELS)]);
        mesh.x_desc(x_label).y_desc(y_label).draw()?;

        let thresholds = quantity.thresholds(slice.qualities.iter().filter(|quality| quality.within_reach()));
        let beyond = rgb(BEYOND).mix(0.4).filled();
        let bands: Vec<_> = thresholds.iter().zip(colors(thresholds.len())).collect();
        let reach = (f64::NAN, beyond);
        let colored = bands.iter().map(|(threshold, color)| (**threshold, rgb(*color).filled()));
        for (threshold, style) in [reach].into_iter().chain(colored) {
            let polygon = self.part(slice, quantity, threshold);
            chart.draw_series([Polygon::new(polygon, style)])?;
        }
        for ((style, _), line) in lines {
            chart.draw_series(seen(line.clone(), *style))?;
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
        draw_bar(area, (end + 2 * MARGIN, top, bottom), &bands)
    }

    /// The part of the reach that is as good as a threshold (all of it for NaN) as one polygon: outlines one after the
    /// other, each from and back to the first, by bridges without width.
    fn part(&self, slice: &Slice, quantity: &Quantity, threshold: f64) -> Vec<(f64, f64)> {
        let numbers = |quality: &PoseQuality| {
            let [beyond, spare] = match threshold {
                _ if threshold.is_nan() => [0.0; 2],
                _ => [quantity.beyond(quality, threshold), quantity.max_force - quality.worst_force],
            };
            [quality.stroke_margin, quality.determinant, beyond, spare]
        };
        let outlines = outlines(slice.count, |places| slice.at(places).map(numbers));
        let origin = outlines.first().and_then(|outline| outline.first()).copied();
        let bridged =
            outlines.iter().flat_map(|outline| outline.iter().chain(outline.first()).chain(&origin));
        bridged.map(|corner| shown(slice, corner.at)).collect()
    }
}

/// `x [m]`
fn axis_label(axis: usize) -> String {
    let names = ["alpha [deg]", "beta [deg]", "gamma [deg]", "x [m]", "y [m]", "z [m]"];
    names.get(axis).copied().unwrap_or_default().into()
}

/// A length in metres, an angle in degrees.
fn in_unit(slice: &Slice, [x, y]: [f64; 2]) -> (f64, f64) {
    let [right, up] = slice.plane.0;
    let unit = |axis: usize, value: f64| if axis < 3 { value.to_degrees() } else { value };
    (unit(right, x), unit(up, y))
}

/// Places on the grid in the units of the axes.
fn shown(slice: &Slice, (right, up): (f64, f64)) -> (f64, f64) {
    let last = (slice.count - 1) as f64;
    let [(left, end), (bottom, top)] = slice.ranges;
    in_unit(slice, [left + right / last * (end - left), bottom + up / last * (top - bottom)])
}

/// Both axes; where they have one unit, a length of one is as long as of the other.
fn axes(slice: &Slice, room: [f64; 2]) -> [Axis; 2] {
    let [(left, right), (bottom, top)] = slice.ranges;
    let (low, high) = (in_unit(slice, [left, bottom]), in_unit(slice, [right, top]));
    let [first, second] = slice.plane.0;
    if (first < 3) == (second < 3) {
        return Axis::with_equal_scales(&[low, high], 0.0, room, TICKS);
    }
    [(low.0, high.0), (low.1, high.1)].map(|(low, high)| Axis::new([low, high].into_iter(), 0.0, TICKS))
}

/// The parts of an outline with one cause.
fn caused(outline: &[Corner], cause: usize) -> Vec<Vec<(f64, f64)>> {
    let mut parts = vec![];
    let mut part: Vec<(f64, f64)> = vec![];
    for corner in outline.iter().chain(outline.first()) {
        part.push(corner.at);
        if corner.cause != Some(cause) {
            // The step to a corner of another cause is still drawn.
            if part.len() > 2 {
                parts.push(core::mem::take(&mut part));
            }
            part = vec![corner.at];
        }
    }
    parts.extend((part.len() > 2).then_some(part));
    parts
}

/// As many colours, from bad to good.
fn colors(count: usize) -> impl Iterator<Item = u32> {
    let last = count.max(2) - 1;
    (0..count).filter_map(move |k| COLORS.get(k * (BANDS - 1) / last).copied())
}

/// White lines lie on colours of any brightness: on a dark one.
fn seen(line: Vec<(f64, f64)>, style: ShapeStyle) -> Vec<PathElement<(f64, f64)>> {
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

/// The last position is that of the mark of home.
fn draw_legend(
    area: &Area,
    samples: &[Sample],
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

/// A disc where the slice goes through home, a ring where home lies before or behind it.
fn draw_home(area: &Area, at: (i32, i32), on_slice: bool) -> Result<(), DrawError> {
    area.draw(&Circle::new(at, DISC, BLACK.stroke_width(32)))?;
    if on_slice {
        area.draw(&Circle::new(at, DISC, BLACK.filled()))?;
    }
    area.draw(&Circle::new(at, DISC, WHITE.stroke_width(15)))
}

/// The colours and the numbers at which they change, the best on top.
fn draw_bar(
    area: &Area,
    (left, top, bottom): (i32, i32, i32),
    bands: &[(&f64, u32)],
) -> Result<(), DrawError> {
    let height = |k: usize| bottom - (bottom - top) * k as i32 / bands.len().max(1) as i32;
    for (k, (threshold, color)) in bands.iter().enumerate() {
        let corners = [(left, height(k + 1)), (left + BAR, height(k))];
        area.draw(&Rectangle::new(corners, rgb(*color).filled()))?;
        let label = if **threshold == f64::MIN_POSITIVE { "0".into() } else { plain(**threshold) };
        area.draw_text(&label, &text(12, HPos::Left), (left + BAR + MARGIN, height(k)))?;
    }
    Ok(())
}
