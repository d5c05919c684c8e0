//! Share of random poses that are found from home, and a million trials of ours.

use hexad::output::charts::{LineStyle, Panel, Series, write_svg};
use rayon::prelude::*;
use serde::Deserialize;

use super::rivals::Update;
use super::trials::{End, Method, ambiguous, pose, step, trial, within_reach};
use super::{Charts, Failure, MACHINES, cells};

/// Largest angle of the poses from home on every axis \[deg\].
const ANGLES_DEG: [u32; 12] = [5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60];
const POSES: u64 = 5000;
const MILLION: u64 = 1_000_000;
const FILE: &str = "stability_maps.csv";
const METHODS: [(&str, Method); 3] = [
    ("hexad", Method::Hexad),
    ("rotation added to angles (genhexkins)", Method::Rival(Update::RotationAdded)),
    ("Newton on Bryan angles", Method::Rival(Update::Angles)),
];

pub fn run(charts: &Charts, fewer: u64) -> Result<(), Failure> {
    let mut rows = vec![];
    for name in MACHINES {
        let machine = hexad_support::machine(name);
        for (method_name, method) in METHODS {
            for angle_deg in ANGLES_DEG {
                let angle = f64::from(angle_deg).to_radians();
                let poses = (0..POSES / fewer).into_par_iter().map(|number| pose(&machine, angle, number));
                let ends: Vec<_> = poses
                    .filter(|x| within_reach(&machine, *x))
                    .map(|x| trial(&machine, method, x))
                    .collect();
                let share = |end: End| ends.iter().filter(|e| **e == end).count() as f64 / ends.len() as f64;
                let shares = [End::Right, End::Failed, End::Wrong].map(share);
                rows.push(cells([
                    &name,
                    &method_name,
                    &angle_deg,
                    &ends.len(),
                    &shares[0],
                    &shares[1],
                    &shares[2],
                ]));
            }
        }
    }
    let header = ["machine", "method", "angle_deg", "reachable_poses", "right", "failed", "wrong"];
    charts.write_csv(FILE, &header, &rows)?;
    million(fewer)
}

/// What the chart needs of a row.
#[derive(Deserialize)]
struct Figure {
    machine: String,
    method: String,
    angle_deg: f64,
    failed: f64,
    wrong: f64,
}

type Share = fn(&Figure) -> f64;

/// Share of failed and of wrong poses against the angle: two panels per machine, a line per method.
pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Figure>(FILE)?;
    let shares: [(&str, Share); 2] = [("failed", |row| row.failed), ("wrong", |row| row.wrong)];
    let mut drawn = vec![];
    for machine in figures.rows.chunk_by(|a, b| a.machine == b.machine) {
        for (what, share) in shares {
            let lines = machine.chunk_by(|a, b| a.method == b.method).map(|method| {
                let points = method.iter().map(|row| (row.angle_deg, 100.0 * share(row)));
                (&*method[0].method, points.collect::<Vec<_>>())
            });
            drawn.push((format!("{what}, {} [%]", machine[0].machine), lines.collect::<Vec<_>>()));
        }
    }
    let panels = drawn.iter().map(|(y_label, lines)| Panel {
        y_label,
        series: lines
            .iter()
            .enumerate()
            .map(|(color, (label, points))| Series { label, points, style: LineStyle::Solid, color })
            .collect(),
    });
    let title = figures.titled("Poses that are not found from home, within reach without a singular pose");
    let panels: Vec<_> = panels.collect();
    write_svg(&charts.path("stability_maps.svg"), &title, "largest angle on every axis [deg]", &panels)?;
    Ok(())
}

/// From home, and from one measurement to the next: nothing wrong that nobody notices.
fn million(fewer: u64) -> Result<(), Failure> {
    let machines: Vec<_> = hexad_support::MACHINES.map(hexad_support::machine).into();
    let trials = MILLION / fewer;
    // reachable, wrong from home, of these unnoticed; followed, refused, deceived steps
    let sums = (0..trials)
        .into_par_iter()
        .map(|number| {
            let machine = &machines[(number % machines.len() as u64) as usize];
            let x = pose(machine, 60_f64.to_radians(), number + (1 << 32));
            if !within_reach(machine, x) {
                return [0; 6];
            }
            let wrong = trial(machine, Method::Hexad, x) == End::Wrong;
            let unnoticed = wrong && !ambiguous(machine, x);
            let [right, failed, deceived] =
                [End::Right, End::Failed, End::Wrong].map(|end| u64::from(step(machine, x, number) == end));
            [1, u64::from(wrong), u64::from(unnoticed), right, failed, deceived]
        })
        .reduce(|| [0; 6], |a, b| std::array::from_fn(|i| a[i] + b[i]));
    let [reachable, wrong, unnoticed, followed, refused, deceived] = sums;
    println!(
        "{trials} random poses of {} machines, {reachable} within reach; from home {wrong} wrong, {unnoticed} of \
         them unnoticed; steps: {followed} followed, {refused} refused, {deceived} deceived",
        machines.len()
    );
    if unnoticed + deceived > 0 {
        return Err("wrong poses that nobody notices".into());
    }
    Ok(())
}
