//! A recording as a picture: position, speed, acceleration and jerk with their limits, and the state.
//!
//! Acceleration and speed are the platform's own, from the simulated plant. The jerk is the reference's.

use std::path::Path;

use hexad::output::charts::{LineStyle, Panel, Series, write_svg};

use super::curves::{Curves, Line};
use super::world::World;

/// What a picture shows of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Picture {
    /// File name without extension.
    pub name: &'static str,
    /// Lines after the first are a subtitle.
    pub title: &'static str,
    /// Begin and end in the recording \[s\].
    pub window_s: [f64; 2],
}

const PLATFORM_COLOR: usize = 0;
const SETPOINT_COLOR: usize = 5;
const BRAKES_COLOR: usize = 6;
const LIMIT_COLOR: usize = 3;
const FEEDBACK_COLOR: usize = 1;

/// Names and colours of the states, by number.
const STATES: [(&str, usize); 7] = [
    ("0 off", 6),
    ("1 standby", 1),
    ("2 engaging", 4),
    ("3 active", 2),
    ("4 stopping", 5),
    ("5 parking", 0),
    ("6 fault", 3),
];
/// A point without a line, so that an axis begins at zero.
const ORIGIN: f64 = 0.0;
const LAST_STATE: f64 = 6.0;

/// Draws into the folder of `HEXAD_CHARTS`, if there is one.
pub fn draw(picture: &Picture, world: &World) {
    let Some(folder) = std::env::var_os("HEXAD_CHARTS") else { return };
    let path = Path::new(&folder).join(picture.name).with_extension("svg");
    let curves = Curves::new(world, picture.window_s);
    let levels = Levels::new(world, curves.window_s);
    let mut panels = vec![position(&curves)];
    // A platform that never moves has nothing but the reason to show.
    if curves.reference.speed.is_empty() {
        panels.push(distance(&curves, &levels));
    } else {
        panels.extend([speed(&curves, &levels), acceleration(&curves, &levels), jerk(&curves, &levels)]);
    }
    panels.push(states(&curves, &levels));
    write_svg(&path, picture.title, "time [s]", &panels).unwrap();
}

/// Horizontal lines over the whole picture.
struct Levels {
    origin: [(f64, f64); 1],
    last_state: [(f64, f64); 1],
    speed: [(f64, f64); 2],
    acceleration: [(f64, f64); 2],
    with_feedback: [(f64, f64); 2],
    jerk: [(f64, f64); 2],
    tolerance_mm: [(f64, f64); 2],
}

impl Levels {
    fn new(world: &World, [begin, end]: [f64; 2]) -> Self {
        let level = |value: f64| [(begin, value), (end, value)];
        let limits = &world.parameters.limits.position;
        Self {
            origin: [(begin, ORIGIN)],
            last_state: [(begin, LAST_STATE)],
            speed: level(limits.velocity),
            acceleration: level(limits.acceleration),
            with_feedback: level((1.0 + world.parameters.feedback_scale) * limits.acceleration),
            jerk: level(limits.jerk),
            tolerance_mm: level(1e3 * world.parameters.engage_position_m),
        }
    }
}

fn position(curves: &Curves) -> Panel<'_> {
    Panel {
        y_label: "z from home [mm]",
        series: thin("setpoint", &curves.setpoint.z_mm)
            .chain(pieces("platform", &curves.platform.z_mm, PLATFORM_COLOR))
            .chain(dashed("reference", &curves.reference.z_mm))
            .collect(),
    }
}

fn distance<'a>(curves: &'a Curves, levels: &'a Levels) -> Panel<'a> {
    Panel {
        y_label: "position error [mm]",
        series: pieces("setpoint to platform", &curves.distance_mm, PLATFORM_COLOR)
            .chain([limit("engage tolerance", &levels.tolerance_mm), solid("", &levels.origin, 0)])
            .collect(),
    }
}

fn speed<'a>(curves: &'a Curves, levels: &'a Levels) -> Panel<'a> {
    Panel {
        y_label: "speed [m/s]",
        series: thin("setpoint", &curves.setpoint.speed)
            .chain(pieces("platform", &curves.platform.speed, PLATFORM_COLOR))
            .chain(dashed("reference", &curves.reference.speed))
            .chain([limit("limit", &levels.speed), solid("", &levels.origin, 0)])
            .collect(),
    }
}

fn acceleration<'a>(curves: &'a Curves, levels: &'a Levels) -> Panel<'a> {
    Panel {
        y_label: "acceleration [m/s²]",
        series: pieces("platform", &curves.acceleration, PLATFORM_COLOR)
            .chain(pieces("in the brakes", &curves.braking, BRAKES_COLOR))
            .chain(dashed("reference", &curves.wanted))
            .chain([limit("limit", &levels.acceleration), solid("", &levels.origin, 0)])
            .chain([bound("limit + feedback", &levels.with_feedback)])
            .collect(),
    }
}

fn jerk<'a>(curves: &'a Curves, levels: &'a Levels) -> Panel<'a> {
    Panel {
        y_label: "jerk [m/s³]",
        series: pieces("reference", &curves.jerk, PLATFORM_COLOR)
            .chain([limit("limit", &levels.jerk), solid("", &levels.origin, 0)])
            .collect(),
    }
}

fn states<'a>(curves: &'a Curves, levels: &'a Levels) -> Panel<'a> {
    let states = curves.states.iter().zip(STATES);
    let refusals = curves.refusals.iter().enumerate().map(|(k, line)| Series {
        label: if k == 0 { "engage refused" } else { "" },
        points: line,
        style: LineStyle::Dashed,
        color: 0,
    });
    // Every picture has room for all states.
    let ends = [solid("", &levels.origin, 0), solid("", &levels.last_state, 0)];
    Panel {
        y_label: "state",
        series: ends
            .into_iter()
            .chain(states.flat_map(|(lines, (label, color))| pieces(label, lines, color)))
            .chain(refusals)
            .collect(),
    }
}

fn solid<'a>(label: &'a str, points: &'a [(f64, f64)], color: usize) -> Series<'a> {
    Series { label, points, style: LineStyle::Solid, color }
}

fn limit<'a>(label: &'a str, points: &'a [(f64, f64)]) -> Series<'a> {
    Series { label, points, style: LineStyle::Thin, color: LIMIT_COLOR }
}

fn bound<'a>(label: &'a str, points: &'a [(f64, f64)]) -> Series<'a> {
    Series { label, points, style: LineStyle::Thin, color: FEEDBACK_COLOR }
}

/// One line with gaps; the legend names it once.
fn pieces<'a>(label: &'a str, pieces: &'a [Line], color: usize) -> impl Iterator<Item = Series<'a>> {
    pieces.iter().enumerate().map(move |(k, piece)| solid(if k == 0 { label } else { "" }, piece, color))
}

fn thin<'a>(label: &'a str, lines: &'a [Line]) -> impl Iterator<Item = Series<'a>> {
    pieces(label, lines, SETPOINT_COLOR).map(|series| Series { style: LineStyle::Thin, ..series })
}

fn dashed<'a>(label: &'a str, lines: &'a [Line]) -> impl Iterator<Item = Series<'a>> {
    pieces(label, lines, PLATFORM_COLOR).map(|series| Series { style: LineStyle::Dashed, ..series })
}
