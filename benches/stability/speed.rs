//! Error of the pose against time: plain Newton by the step, ours, and the others, from several starts.

use hexad::model::forward_kinematics::refine;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::inverse_jacobian::twist_from_rates;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::machine::Machine;
use hexad::model::rigid::{Pose, Twist};
use hexad::model::task::task_coordinates;
use hexad::output::charts::LineStyle;
use nalgebra::{Vector3, Vector6};
use serde::Deserialize;

use super::rivals::Update;
use super::support::scatter::{Grid, Label, Line, Mark, Point, Sample, Scatter, Width, fit_ranges};
use super::timing::{Samples, sample};
use super::trials::{pose, rigid};
use super::{Charts, Failure, MACHINES, cells, rivals};

const FILE: &str = "stability_speed.csv";

/// Starts by their distance: 2 mm and 0.2 degrees, a tenth and a hundredth of it, five times.
const STARTS: [(&str, f64); 4] = [("0.02 mm", 0.01), ("0.2 mm", 0.1), ("2 mm", 1.0), ("10 mm", 5.0)];
const SHIFT_M: f64 = 2e-3;
const TURN: f64 = 0.2 * core::f64::consts::PI / 180.0;

const MOST_STEPS: u32 = 4;
const ROUNDS: usize = 31;
const QUICK_ROUNDS: usize = 3;
const SAMPLE_S: f64 = 1e-3;
const POSES: u64 = 100;
/// Errors below this are rounding: where the chart ends.
const ROUNDING: f64 = 1e-16;

/// A pose, its lengths, and where its search starts.
struct Case {
    there: Pose,
    lengths: [f64; 6],
    start: Pose,
    start_x: [f64; 6],
    kinematic_state: KinematicState,
}

/// So many steps of plain Newton, a new factorization each.
pub fn newton(machine: &Machine, start: &Pose, lengths: &[f64; 6], steps: u32) -> Pose {
    (0..steps).fold(*start, |pose, _| {
        let rest = Vector6::from(*lengths) - Vector6::from(leg_lengths(machine, &pose));
        twist_from_rates(machine, &pose, &rest.into()).map_or(pose, |step| pose.displaced(&step))
    })
}

fn cases(machine: &Machine, distance: f64) -> Vec<Case> {
    let direction = |k: u64| {
        let [a, b, c, ..] = pose(machine, 1.0, k + 77);
        let [h0, h1, h2, ..] = machine.home;
        Vector3::new(a - h0, b - h1, c - h2).normalize()
    };
    (0..POSES)
        .map(|k| {
            let x = pose(machine, 0.2, k);
            let there = rigid(x);
            let angular = direction(2 * k) * (TURN * distance);
            let linear = direction(2 * k + 1) * (SHIFT_M * distance);
            let start = there.displaced(&Twist { angular, linear });
            let start_x = task_coordinates(&start, &x);
            let lengths = leg_lengths(machine, &there);
            Case { there, lengths, start, start_x, kinematic_state: KinematicState::new(machine, start) }
        })
        .collect()
}

/// A method, timed and judged.
struct Row {
    method: String,
    machine: &'static str,
    start: &'static str,
    ns: f64,
    error: f64,
}

pub fn run(charts: &Charts, quick: bool) -> Result<(), Failure> {
    let rounds = if quick { QUICK_ROUNDS } else { ROUNDS };
    let mut rows = vec![];
    for name in MACHINES {
        let machine = hexad_support::machine(name);
        for (start, distance) in STARTS {
            let cases = cases(&machine, distance);
            let mut add = |method: String, find: &dyn Fn(&Case) -> Pose| {
                let errors = cases.iter().map(|case| {
                    let way = find(case).displacement_to(&case.there);
                    way.linear.norm().max(way.angular.norm() * machine.joints.radius_m)
                });
                let error = errors.fold(0.0, f64::max);
                let mut samples = Samples::default();
                for _ in 0..rounds {
                    samples
                        .take(cases.len(), SAMPLE_S, |passes, fenced| sample(&cases, passes, fenced, find));
                }
                rows.push(Row { method, machine: name, start, ns: samples.latency(), error });
            };
            for steps in 1..=MOST_STEPS {
                add(format!("newton {steps}"), &|case| newton(&machine, &case.start, &case.lengths, steps));
            }
            add("hexad".into(), &|case| {
                let mut kinematic_state = case.kinematic_state;
                refine(&machine, &mut kinematic_state, &case.lengths);
                *kinematic_state.pose()
            });
            add("hexad from a pose".into(), &|case| {
                let mut kinematic_state = KinematicState::new(&machine, case.start);
                refine(&machine, &mut kinematic_state, &case.lengths);
                *kinematic_state.pose()
            });
            for (method, update) in
                [("rotation added to angles", Update::RotationAdded), ("Newton on angles", Update::Angles)]
            {
                add(method.into(), &|case| {
                    let found = rivals::solve(&machine, update, &case.start_x, &case.lengths);
                    found.map_or(case.start, |(x, _)| rigid(x))
                });
            }
        }
    }
    for row in rows.iter().filter(|row| row.start == "2 mm") {
        println!("{:<12}{:<26}{:>8.0} ns{:>10.1e} m", row.machine, row.method, row.ns, row.error);
    }
    let table: Vec<_> = rows
        .iter()
        .map(|row| {
            let (ns, error) = (format!("{:.1}", row.ns), format!("{:.2e}", row.error));
            cells([&row.machine, &row.method, &row.start, &ns, &error])
        })
        .collect();
    charts.write_csv(FILE, &["machine", "method", "start", "ns_fenced", "error_max_m"], &table)
}

/// What the chart needs of a row.
#[derive(Deserialize)]
struct Figure {
    machine: String,
    method: String,
    start: String,
    ns_fenced: f64,
    error_max_m: f64,
}

/// The motion base: a line per start, a point per step.
pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Figure>(FILE)?;
    let of = |start: &str, is_found: &dyn Fn(&str) -> bool| -> Vec<(f64, f64)> {
        let rows = figures.rows.iter().filter(|row| row.machine == "motion_base" && row.start == start);
        let rows = rows.filter(|row| is_found(&row.method));
        rows.map(|row| (row.ns_fenced, row.error_max_m.max(ROUNDING))).collect()
    };
    let (mut points, mut lines) = (vec![], vec![]);
    for (color, (start, _)) in STARTS.iter().enumerate() {
        let plain = of(start, &|method| method.starts_with("newton "));
        lines.push(Line { points: plain.clone(), style: LineStyle::Solid, color, width: Width::Hair });
        let ours = of(start, &|method| method == "hexad");
        let others = of(start, &|method| method.contains("angles"));
        for (marks, mark) in [(plain, Mark::Disc), (others, Mark::Disc), (ours, Mark::Ring)] {
            points.extend(marks.into_iter().map(|at| Point { at, mark, color, label: Label::None }));
        }
    }
    let labels = STARTS.map(|(start, _)| format!("Newton, 1 to {MOST_STEPS} steps, from {start}"));
    let mut legend: Vec<_> = labels
        .iter()
        .enumerate()
        .map(|(k, label)| (Sample::Line(LineStyle::Solid, Width::Hair, k), &**label))
        .collect();
    legend.push((Sample::Mark(Mark::Ring, 2), "hexad, factorization included"));
    legend.push((Sample::Mark(Mark::Disc, 2), "alone at the right: updates of Bryan angles"));
    let mut drawn = vec![Scatter {
        x_label: "time, one thread [ns]",
        y_label: "largest error [m]",
        points,
        lines,
        ..Scatter::default()
    }];
    fit_ranges(&mut drawn, true);
    let title = figures.titled("Forward kinematics: error of the pose against time, motion base");
    Grid { title: &title, legend, columns: 1, charts: drawn }
        .write_svg(&charts.path("stability_speed.svg"))?;
    Ok(())
}
