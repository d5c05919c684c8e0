//! A recording as a picture: position, acceleration and jerk of the platform with their limits, forces, state.

use std::path::Path;

use hexad::control::diagnostic::DiagnosticCode;
use hexad::control::state::State;
use hexad::model::rigid::Twist;
use hexad::output::charts::{LineStyle, Panel, Series, write_svg};

use super::recording::Sample;
use super::world::World;

type Line = Vec<(f64, f64)>;

/// Positions and forces change little from cycle to cycle: every fifth is drawn.
const THINNED: usize = 5;

/// Draws into the folder of `HEXAD_CHARTS`, if there is one.
pub fn draw(name: &str, title: &str, world: &World) {
    let Some(folder) = std::env::var_os("HEXAD_CHARTS") else { return };
    let path = Path::new(&folder).join(name).with_extension("svg");
    let curves = Curves::new(world);
    let limits = &world.parameters.limits.position;
    let end = curves.end;
    let level = |value: f64| [(0.0, value), (end, value)];
    let [acceleration, jerk, tolerance] =
        [limits.acceleration, limits.jerk, 1e3 * world.parameters.engage_position].map(level);
    let bound = |label, points| Series { label, points, style: LineStyle::Dashed, color: 0 };
    let dashed = |label, points, color| Series { label, points, style: LineStyle::Dashed, color };
    let setpoints = curves.setpoint.iter().enumerate().flat_map(|(color, axis)| {
        // One word in the legend for all dashed lines.
        let label = if color == 2 { "setpoint" } else { "" };
        axis.iter().enumerate().map(move |(k, piece)| dashed(if k == 0 { label } else { "" }, piece, color))
    });
    let mut panels = vec![Panel {
        y_label: "position [mm]",
        series: lines(&["x", "y", "z"], &curves.position).into_iter().chain(setpoints).collect(),
    }];
    // Without forces there is no motion to show; what there is, is the reason.
    if world.recording.samples.iter().any(|sample| sample.force.is_some()) {
        panels.extend([
            Panel {
                y_label: "acceleration [m/s²]",
                series: pieces("by the drives", &curves.acceleration, 0)
                    .chain(pieces("in the brakes", &curves.braking, 3))
                    .chain([bound("limit", &acceleration)])
                    .collect(),
            },
            Panel {
                y_label: "jerk [m/s³]",
                series: pieces("by the drives", &curves.jerk, 0)
                    .chain([bound("limit", &jerk), solid("", &ORIGIN, 0)])
                    .collect(),
            },
            Panel { y_label: "force [kN]", series: lines(&LEGS, &curves.force) },
        ]);
    } else {
        panels.push(Panel {
            y_label: "position error [mm]",
            series: pieces("setpoint to platform", &curves.error, 0)
                .chain([bound("engage tolerance", &tolerance), solid("", &ORIGIN, 0)])
                .collect(),
        });
    }
    let states = curves.states.iter().zip(STATES);
    let states = states.flat_map(|(lines, (label, color))| pieces(label, lines, color));
    let refusal = curves.refusal.map(|t| [(t, FIRST_STATE), (t, LAST_STATE)]);
    let refusal = refusal.iter().map(|line| dashed("engage refused", line, 0));
    // Points without a line, so that every picture has room for all states.
    let ends = [[(0.0, FIRST_STATE)], [(0.0, LAST_STATE)]];
    panels.push(Panel {
        y_label: "state",
        series: ends.iter().map(|end| solid("", end, 0)).chain(states).chain(refusal).collect(),
    });
    write_svg(&path, title, "time [s]", &panels).unwrap();
}

/// A point without a line, so that an axis begins at zero.
const ORIGIN: [(f64, f64); 1] = [(0.0, 0.0)];
const LEGS: [&str; 6] = ["leg 1", "leg 2", "leg 3", "leg 4", "leg 5", "leg 6"];
/// Names and colours, by number.
const STATES: [(&str, usize); 7] = [
    ("0 off", 6),
    ("1 standby", 1),
    ("2 engaging", 4),
    ("3 active", 2),
    ("4 stopping", 5),
    ("5 parking", 0),
    ("6 fault", 3),
];
const FIRST_STATE: f64 = 0.0;
const LAST_STATE: f64 = 6.0;

fn solid<'a>(label: &'a str, points: &'a [(f64, f64)], color: usize) -> Series<'a> {
    Series { label, points, style: LineStyle::Solid, color }
}

fn lines<'a>(names: &[&'a str], lines: &'a [Line]) -> Vec<Series<'a>> {
    names.iter().zip(lines).enumerate().map(|(color, (name, line))| solid(name, line, color)).collect()
}

/// One line with gaps.
fn pieces<'a>(label: &'a str, pieces: &'a [Line], color: usize) -> impl Iterator<Item = Series<'a>> {
    pieces.iter().enumerate().map(move |(k, piece)| solid(if k == 0 { label } else { "" }, piece, color))
}

struct Curves {
    end: f64,
    position: [Line; 3],
    setpoint: [Vec<Line>; 3],
    /// Distance of the setpoint from the platform \[mm\].
    error: Vec<Line>,
    /// Time of the first refused request to engage \[s\].
    refusal: Option<f64>,
    acceleration: Vec<Line>,
    braking: Vec<Line>,
    jerk: Vec<Line>,
    force: [Line; 6],
    states: [Vec<Line>; 7],
}

impl Curves {
    fn new(world: &World) -> Self {
        let samples = &world.recording.samples;
        let begin_ns = samples[0].time_ns;
        let period_s = world.parameters.period_ns as f64 * 1e-9;
        let seconds = |sample: &Sample| (sample.time_ns - begin_ns) as f64 * 1e-9;
        let [_, _, _, x, y, z] = world.machine.home;
        let home = nalgebra::Vector3::new(x, y, z);
        let thinned = |of: &dyn Fn(&Sample) -> f64| -> Line {
            samples.iter().step_by(THINNED).map(|at| (seconds(at), of(at))).collect()
        };
        // Of each cycle and the one before it.
        let pairwise = |of: &dyn Fn(&Sample, &Sample) -> Option<f64>| {
            split(samples.windows(2).map(|pair| (seconds(&pair[1]), of(&pair[0], &pair[1]))))
        };
        let speed_up = |before: &Twist, now: &Twist| (now.linear - before.linear).norm() / period_s;
        Self {
            end: seconds(samples.last().unwrap()),
            position: [0, 1, 2].map(|axis| thinned(&|at| (at.pose.position - home)[axis] * 1e3)),
            setpoint: [0, 1, 2].map(|axis| {
                let of = |at: &Sample| at.setpoint.map(|task| (task.x[3 + axis] - home[axis]) * 1e3);
                split(samples.iter().step_by(THINNED).map(|at| (seconds(at), of(at))))
            }),
            error: pairwise(&|_, now| {
                let setpoint = now.setpoint?.motion().pose.position;
                Some(1e3 * (setpoint - now.pose.position).norm())
            }),
            refusal: samples
                .iter()
                .find(|sample| sample.output.request_diagnostic.code != DiagnosticCode::None)
                .map(seconds),
            acceleration: pairwise(&|_, now| now.acceleration.map(|a| a.linear.norm())),
            braking: pairwise(&|before, now| {
                now.acceleration.is_none().then(|| speed_up(&before.twist, &now.twist))
            }),
            jerk: pairwise(&|before, now| {
                Some((now.acceleration?.linear - before.acceleration?.linear).norm() / period_s)
            }),
            force: core::array::from_fn(|leg| thinned(&|at| at.force.map_or(0.0, |force| force[leg] * 1e-3))),
            states: State::ALL.map(|state| {
                pairwise(&|_, now| (now.output.state == state).then_some(f64::from(state as u32)))
                    .into_iter()
                    // A state of a single cycle would have a name and no line.
                    .filter(|piece| piece.len() > 1)
                    .map(|piece| vec![piece[0], *piece.last().unwrap()])
                    .collect()
            }),
        }
    }
}

/// Runs of points that are there.
fn split(points: impl Iterator<Item = (f64, Option<f64>)>) -> Vec<Line> {
    let mut pieces: Vec<Line> = vec![];
    let mut gap = true;
    for (t, value) in points {
        match value {
            Some(value) if gap => pieces.push(vec![(t, value)]),
            Some(value) => pieces.last_mut().unwrap().push((t, value)),
            None => {}
        }
        gap = value.is_none();
    }
    pieces
}
