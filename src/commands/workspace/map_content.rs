//! Content of the maps of a slice: quantities, lines, and the polygons of their colours.

use core::f64::consts::TAU;

use plotters::prelude::*;

use super::bands::{Better, Quantity, plain};
use super::contour::{Corner, outlines};
use super::map::MapDrawing;
use super::slice::Slice;
use crate::output::svg::{DASHED_INK, INK, rgb};
use hexad_machine::analysis::pose_quality::PoseQuality;

/// Largest coloured force, as a multiple of the least one, if every pose needs more force than the actuators
/// have.
const MAX_FORCE_RATIO: f64 = 5.0;
/// Colour of the lines at which a singular pose ends the reach.
const SINGULAR_COLOR: u32 = 0xC8_430F;
/// Colour of the hatch, which no map has.
const AMBIGUOUS_COLOR: u32 = 0xFF_5FA2;

/// Style and name of a line in the legend.
pub(super) type LegendSample = (ShapeStyle, &'static str);

/// Line over the colours of a map, in the units of the axes, with its sample in the legend.
pub(super) type MapLine = (LegendSample, Vec<(f64, f64)>);

impl MapDrawing<'_> {
    /// The four quantities of the maps.
    pub(super) fn quantities(&self, slice: &Slice) -> [Quantity; 4] {
        let max_force = self.machine.actuator.weakest_available_force_n();
        let reached = || slice.qualities.iter().filter(|quality| quality.within_reach());
        // If every pose needs more force than the actuators have, the map still shows how much.
        let is_possible = reached().any(|quality| quality.worst_force_n <= max_force);
        let (force_label, payload_label, max_force) = if is_possible {
            ("worst force [N]", "payload [kg]", max_force)
        } else {
            let least = reached().map(|quality| quality.worst_force_n).fold(f64::INFINITY, f64::min);
            (
                "worst force [N], nowhere within the limit",
                "payload [kg]: none anywhere",
                MAX_FORCE_RATIO * least,
            )
        };
        [
            Quantity {
                label: "stroke margin [m]",
                value: |quality| quality.stroke_margin_m,
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
                value: |quality| quality.worst_force_n,
                better: Better::Lower,
                worst: max_force,
                max_force,
            },
            Quantity {
                label: payload_label,
                value: |quality| quality.payload_kg,
                better: Better::Higher,
                // The payload is 0 for all poses beyond the limit, so only the forces show the edge.
                worst: f64::MIN_POSITIVE,
                max_force,
            },
        ]
    }

    /// Text of the pose through which the slice goes.
    pub(super) fn place(&self, slice: &Slice) -> String {
        if slice.through == self.machine.home {
            return "home".into();
        }
        let [a, b, c, x, y, z] = slice.through;
        let [a, b, c] = [a, b, c].map(|angle| plain(angle.to_degrees(), 3));
        let [x, y, z] = [x, y, z].map(|x| plain(x, 3));
        format!("{a}, {b}, {c} deg, {x}, {y}, {z} m")
    }

    /// Lines for the limits of the reach and for the ball without obstacle.
    pub(super) fn lines(&self, slice: &Slice) -> Vec<MapLine> {
        let edge = |quality: &PoseQuality| [quality.stroke_margin_m, quality.determinant];
        let reach = outlines(slice.count, |places| slice.at(places).map(edge));
        let limit = |quality: &PoseQuality| {
            [quality.stroke_margin_m, quality.determinant, self.largest_condition - quality.condition]
        };
        let limited = outlines(slice.count, |places| slice.at(places).map(limit));
        let kinds = [
            (&reach, 0, (rgb(INK).stroke_width(18), "end of stroke")),
            (&reach, 1, (rgb(SINGULAR_COLOR).stroke_width(25), "singular poses")),
            (&limited, 2, (rgb(DASHED_INK).stroke_width(18), "limit of the condition")),
        ];
        let mut lines = vec![];
        for (outlines, cause, sample) in kinds {
            let parts = outlines.iter().flat_map(|outline| caused(outline, cause));
            lines.extend(parts.map(|part| (sample, part.into_iter().map(|at| on_axes(slice, at)).collect())));
        }
        lines.extend(hatch(slice));
        if self.has_ball(slice) {
            let [x, y] = slice.plane.0.map(|axis| self.machine.home.get(axis).copied().unwrap_or_default());
            let angles = (0..=90).map(|k| f64::from(k) * TAU / 90.0);
            let circle: Vec<_> = angles.map(|a| (x + self.ball * a.cos(), y + self.ball * a.sin())).collect();
            lines.push(((WHITE.stroke_width(15), "ball without obstacle"), circle));
        }
        lines
    }

    /// Whether the slice contains the centre of the ball.
    fn has_ball(&self, slice: &Slice) -> bool {
        slice.through == self.machine.home && slice.plane.0.iter().all(|axis| *axis >= 3)
    }

    /// One polygon of the poses in reach that satisfy a threshold (all poses for NaN). Its outlines follow
    /// each other, each connected to the first by a bridge of zero width.
    pub(super) fn polygon(&self, slice: &Slice, quantity: &Quantity, threshold: f64) -> Vec<(f64, f64)> {
        let numbers = |quality: &PoseQuality| {
            let [margin, spare_force] = match threshold {
                _ if threshold.is_nan() => [0.0; 2],
                _ => [quantity.margin(quality, threshold), quantity.max_force - quality.worst_force_n],
            };
            [quality.stroke_margin_m, quality.determinant, margin, spare_force]
        };
        let outlines = outlines(slice.count, |places| slice.at(places).map(numbers));
        let origin = outlines.first().and_then(|outline| outline.first()).copied();
        let bridged =
            outlines.iter().flat_map(|outline| outline.iter().chain(outline.first()).chain(&origin));
        bridged.map(|corner| on_axes(slice, corner.at)).collect()
    }
}

/// A line through each row of neighbours with another permitted pose.
fn hatch(slice: &Slice) -> Vec<MapLine> {
    let (step, ambiguous) = (slice.search_step, slice.ambiguous().collect::<Vec<_>>());
    let sample = (rgb(AMBIGUOUS_COLOR).stroke_width(15), "another permitted pose, same lengths");
    let line = |run: &[[usize; 2]]| {
        let ends = [(run.first()?, -0.5), (run.last()?, 0.5)];
        let at = |([right, up], side): (&[usize; 2], f64)| (*right as f64 + side * step as f64, *up as f64);
        Some((sample, ends.map(|end| on_axes(slice, at(end))).into()))
    };
    ambiguous.chunk_by(|[left, up], next| *next == [left + step, *up]).filter_map(line).collect()
}

/// A position in the units of the axes: metres and degrees.
pub(super) fn in_unit(slice: &Slice, [x, y]: [f64; 2]) -> (f64, f64) {
    let [right, up] = slice.plane.0;
    let unit = |axis: usize, value: f64| if axis < 3 { value.to_degrees() } else { value };
    (unit(right, x), unit(up, y))
}

/// A position on the grid in the units of the axes.
fn on_axes(slice: &Slice, (right, up): (f64, f64)) -> (f64, f64) {
    let last = (slice.count - 1) as f64;
    let [(left, end), (bottom, top)] = slice.ranges;
    in_unit(slice, [left + right / last * (end - left), bottom + up / last * (top - bottom)])
}

/// Parts of an outline caused by one number.
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
