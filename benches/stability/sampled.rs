//! Where the sampled loop turns unstable: predicted, and found with the real controller and the real plant.

use hexad::analysis::sampled_loop::SampledLoop;
use hexad::output::charts::{Panel, Series, Stroke, write_svg};
use rayon::prelude::*;

use super::delayed::boundary;
use super::{Failure, cells, chart, common, write_csv};

/// In periods.
const MAX_DELAY_PERIODS: u32 = 2;
/// Points per period: of the simulation, and of the line.
const FOUND: u32 = 4;
const PREDICTED: u32 = 100;

const DAMPING_RATIOS: [f64; 4] = [0.3, 0.7, 1.0, 2.0];
/// Of the platform over that of the model.
const MASS_RATIOS: [f64; 5] = [0.3, 0.5, 1.0, 2.0, 3.0];

/// A prediction that is further off is wrong.
const TOLERANCE: f64 = 0.02;

/// Half a mark: in periods, and as a share of the largest limit of its panel.
const MARK: (f64, f64) = (0.016, 0.018);

/// A point: delay, `wn T`.
type At = (f64, f64);

pub fn run() -> Result<(), Failure> {
    let mut config = common::deployed("fried2008");
    config.machine.gravity.fill(0.0);
    let of = |damping_ratio, mass_ratio| SampledLoop {
        wn_t: f64::NAN,
        damping_ratio,
        observer: 0.0,
        delay: f64::NAN,
        mass_ratio,
    };
    let dampings = DAMPING_RATIOS.map(|ratio| (format!("damping ratio {ratio}"), of(ratio, 1.0)));
    let masses = MASS_RATIOS.map(|ratio| (format!("{ratio} of the modelled mass"), of(1.0, ratio)));
    let mut rows = vec![];
    let mut drawn = vec![];
    for (y_label, curves) in
        [("largest wn T, mass as modelled", &dampings[..]), ("largest wn T, damping ratio 1", &masses)]
    {
        let mut lines = vec![];
        for (label, sampled) in curves {
            let predict = |delay| SampledLoop { delay, ..*sampled }.largest_wn_t();
            let found: Vec<At> = delays(FOUND)
                .into_par_iter()
                .map(|delay| (delay, boundary(&config, &SampledLoop { delay, ..*sampled })))
                .collect();
            let mut worst = 0.0_f64;
            for (delay, found) in &found {
                let predicted = predict(*delay);
                worst = worst.max((found / predicted - 1.0).abs());
                let SampledLoop { damping_ratio, mass_ratio, .. } = sampled;
                let [predicted, found] = [predicted, *found].map(|wn_t| format!("{wn_t:.4}"));
                rows.push(cells([damping_ratio, mass_ratio, delay, &predicted, &found]));
            }
            println!("sampled loop, {label}: limit as predicted to {:.2} %", 100.0 * worst);
            if worst > TOLERANCE {
                return Err(format!("{label}: the limit is not the predicted one").into());
            }
            let predicted: Vec<At> =
                delays(PREDICTED).into_iter().map(|delay| (delay, predict(delay))).collect();
            lines.push((label, predicted, found));
        }
        let largest = lines.iter().flat_map(|(_, line, _)| line).map(|(_, wn_t)| *wn_t).fold(0.0, f64::max);
        let mark = |at| diamond(at, MARK.0, MARK.1 * largest);
        let marked = lines
            .into_iter()
            .map(|(label, line, found)| (label, line, found.into_iter().map(mark).collect::<Vec<_>>()));
        drawn.push((y_label, marked.collect::<Vec<_>>()));
    }
    let header = ["damping_ratio", "mass_ratio", "delay_periods", "wn_t_predicted", "wn_t_simulated"];
    write_csv("stability_sampled.csv", &header, &rows)?;
    let panels = drawn.iter().map(|(y_label, lines)| Panel {
        y_label,
        series: lines
            .iter()
            .enumerate()
            .flat_map(|(color, (label, predicted, found))| {
                let series = move |label, points| Series { label, points, style: Stroke::Solid, color };
                let marks = found.iter().map(move |mark| series("", &mark[..]));
                [series(label, &predicted[..])].into_iter().chain(marks)
            })
            .collect(),
    });
    let title = "Stability limit of the sampled loop: lines predicted, diamonds simulated";
    let x_label = "from measurement to force [periods]";
    write_svg(&chart("stability_sampled.svg"), title, x_label, &panels.collect::<Vec<_>>())?;
    Ok(())
}

/// From none to the longest.
fn delays(per_period: u32) -> Vec<f64> {
    (0..=MAX_DELAY_PERIODS * per_period).map(|k| f64::from(k) / f64::from(per_period)).collect()
}

fn diamond((x, y): At, dx: f64, dy: f64) -> Vec<At> {
    vec![(x - dx, y), (x, y + dy), (x + dx, y), (x, y - dy), (x - dx, y)]
}
