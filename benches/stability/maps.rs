//! Share of random poses that are found from home, and a million trials of ours.

use hexad::output::charts::{Panel, Series, Stroke, write_svg};
use rayon::prelude::*;

use super::rivals::Update;
use super::trials::{End, Method, ambiguous, pose, step, trial, within_reach};
use super::{Failure, MACHINES, cells, chart, common, write_csv};

/// Largest angle of the poses from home on every axis \[deg\].
const ANGLES_DEG: [u32; 12] = [5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60];
const POSES: u64 = 5000;
const MILLION: u64 = 1_000_000;
const METHODS: [(&str, Method); 3] = [
    ("hexad", Method::Hexad),
    ("rotation added to angles (genhexkins)", Method::Rival(Update::RotationAdded)),
    ("Newton on Bryan angles", Method::Rival(Update::Angles)),
];

pub fn run(fewer: u64) -> Result<(), Failure> {
    let mut rows = vec![];
    let mut lines = vec![];
    for name in MACHINES {
        let machine = common::machine(name);
        for (method_name, method) in METHODS {
            let (mut failed, mut wrong) = (vec![], vec![]);
            for angle_deg in ANGLES_DEG {
                let angle = f64::from(angle_deg).to_radians();
                let poses = (0..POSES / fewer).into_par_iter().map(|number| pose(&machine, angle, number));
                let ends: Vec<_> = poses
                    .filter(|x| within_reach(&machine, *x))
                    .map(|x| trial(&machine, method, x))
                    .collect();
                let share = |end: End| ends.iter().filter(|e| **e == end).count() as f64 / ends.len() as f64;
                failed.push((f64::from(angle_deg), 100.0 * share(End::Failed)));
                wrong.push((f64::from(angle_deg), 100.0 * share(End::Wrong)));
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
            lines.push([failed, wrong]);
        }
    }
    let header = ["machine", "method", "angle_deg", "reachable_poses", "right", "failed", "wrong"];
    write_csv("stability_maps.csv", &header, &rows)?;
    draw(&lines)?;
    million(fewer)
}

/// Share of failed and of wrong poses against the angle, of one method on one machine.
type Lines = [Vec<(f64, f64)>; 2];

/// Two panels per machine.
fn draw(lines: &[Lines]) -> Result<(), Failure> {
    let labels: Vec<_> = MACHINES
        .iter()
        .flat_map(|name| ["failed", "wrong"].map(|what| format!("{what}, {name} [%]")))
        .collect();
    let mut panels = vec![];
    for (index, of_machine) in lines.chunks(METHODS.len()).enumerate() {
        for what in 0..2 {
            let series = of_machine.iter().zip(METHODS).enumerate().map(|(color, (line, (label, _)))| {
                Series { label, points: &line[what], style: Stroke::Solid, color }
            });
            panels.push(Panel { y_label: &labels[2 * index + what], series: series.collect() });
        }
    }
    let title = "Poses that are not found from home, within reach without a singular pose";
    write_svg(&chart("stability_maps.svg"), title, "largest angle on every axis [deg]", &panels)?;
    Ok(())
}

/// From home, and from one measurement to the next: nothing wrong that nobody notices.
fn million(fewer: u64) -> Result<(), Failure> {
    let machines: Vec<_> = common::MACHINES.map(common::machine).into();
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
