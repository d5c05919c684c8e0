//! A recording as a picture: position, acceleration and jerk of the platform with their limits, forces, state.

use std::path::Path;

use hexad::control::state::State;
use hexad::model::rigid::Twist;
use hexad::output::charts::{Panel, Series, Stroke, write_svg};

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
    let (acceleration, jerk) =
        ([(0.0, limits.acceleration), (end, limits.acceleration)], [(0.0, limits.jerk), (end, limits.jerk)]);
    let limit = |points| Series { label: "limit", points, style: Stroke::Dashed, color: 0 };
    // Points without a line, so that every picture has room for all states.
    let ends = [[(0.0, 0.0)], [(0.0, 6.0)]];
    let states = curves.states.iter().zip(STATES).enumerate();
    let states = states.flat_map(|(color, (lines, label))| pieces(label, lines, color));
    let dashed = |label, points, color| Series { label, points, style: Stroke::Dashed, color };
    let setpoints = curves.setpoint.iter().enumerate().flat_map(|(color, axis)| {
        // One word in the legend for all dashed lines.
        let label = if color == 2 { "setpoint" } else { "" };
        axis.iter().enumerate().map(move |(k, piece)| dashed(if k == 0 { label } else { "" }, piece, color))
    });
    let panels = [
        Panel {
            y_label: "position [mm]",
            series: lines(&["x", "y", "z"], &curves.position).into_iter().chain(setpoints).collect(),
        },
        Panel {
            y_label: "acceleration [m/s²]",
            series: pieces("by the drives", &curves.acceleration, 0)
                .chain(pieces("in the brakes", &curves.braking, 3))
                .chain([limit(&acceleration)])
                .collect(),
        },
        Panel {
            y_label: "jerk [m/s³]",
            series: pieces("by the drives", &curves.jerk, 0)
                .chain([limit(&jerk), solid("", &ends[0], 0)])
                .collect(),
        },
        Panel { y_label: "force [kN]", series: lines(&LEGS, &curves.force) },
        Panel { y_label: "state", series: ends.iter().map(|end| solid("", end, 0)).chain(states).collect() },
    ];
    write_svg(&path, title, "time [s]", &panels).unwrap();
}

const LEGS: [&str; 6] = ["leg 1", "leg 2", "leg 3", "leg 4", "leg 5", "leg 6"];
const STATES: [&str; 7] =
    ["0 off", "1 standby", "2 engaging", "3 active", "4 stopping", "5 parking", "6 fault"];

fn solid<'a>(label: &'a str, points: &'a [(f64, f64)], color: usize) -> Series<'a> {
    Series { label, points, style: Stroke::Solid, color }
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
