//! Where the sampled loop turns unstable: predicted, and found with the real controller and the real plant.

use hexad::analysis::sampled_loop::SampledLoop;
use hexad::output::charts::{LineStyle, Panel, Series, write_svg};
use rayon::prelude::*;
use serde::Deserialize;

use super::delayed::boundary;
use super::{Charts, Failure, cells};

const FILE: &str = "stability_sampled.csv";

/// In periods.
const MAX_DELAY_PERIODS: u32 = 2;
/// Points per period: of the simulation, and of the line.
const FOUND: u32 = 4;
const PREDICTED: u32 = 100;
/// The one delay of a quick run.
const QUICK_DELAY: f64 = 1.0;

const DAMPING_RATIOS: [f64; 4] = [0.3, 0.7, 1.0, 2.0];
/// Of the platform over that of the model. With the estimator as fast as the loop, no gain is stable below 0.4 and above 2.8.
const MASS_RATIOS: [f64; 5] = [0.5, 0.7, 1.0, 1.5, 2.0];

/// A prediction that is further off is wrong.
const TOLERANCE: f64 = 0.02;

/// Half a mark: in periods, and as a share of the largest limit of its panel.
const MARK: (f64, f64) = (0.016, 0.018);

/// A point: delay, `wn T`.
type At = (f64, f64);

/// The loops of the chart, without delay.
fn loops() -> Vec<SampledLoop> {
    let of = |damping_ratio, mass_ratio| SampledLoop {
        wn_t: f64::NAN,
        damping_ratio,
        delay_periods: f64::NAN,
        mass_ratio,
        ..SampledLoop::default()
    };
    let dampings = DAMPING_RATIOS.map(|ratio| of(ratio, 1.0));
    let masses = MASS_RATIOS.map(|ratio| of(1.0, ratio));
    dampings.into_iter().chain(masses).collect()
}

pub fn run(charts: &Charts, quick: bool) -> Result<(), Failure> {
    let mut config = hexad_support::deployed("fried2008");
    config.machine.gravity_m_s2.fill(0.0);
    let delays = if quick { vec![QUICK_DELAY] } else { delays(FOUND) };
    let mut rows = vec![];
    for sampled in loops() {
        let SampledLoop { damping_ratio, mass_ratio, .. } = sampled;
        let found: Vec<At> = delays
            .par_iter()
            .map(|delay| (*delay, boundary(&config, &SampledLoop { delay_periods: *delay, ..sampled })))
            .collect();
        let mut worst = 0.0_f64;
        for (delay, found) in &found {
            let predicted = SampledLoop { delay_periods: *delay, ..sampled }.largest_wn_t();
            worst = worst.max((found / predicted - 1.0).abs());
            let [predicted, found] = [predicted, *found].map(|wn_t| format!("{wn_t:.4}"));
            rows.push(cells([&damping_ratio, &mass_ratio, delay, &predicted, &found]));
        }
        let label = format!("damping ratio {damping_ratio}, {mass_ratio} of the modelled mass");
        println!("sampled loop, {label}: limit as predicted to {:.2} %", 100.0 * worst);
        if worst > TOLERANCE {
            return Err(format!("{label}: the limit is not the predicted one").into());
        }
    }
    let header = ["damping_ratio", "mass_ratio", "delay_periods", "wn_t_predicted", "wn_t_simulated"];
    charts.write_csv(FILE, &header, &rows)
}

/// What the chart needs of a row.
#[derive(Deserialize)]
struct Figure {
    delay_periods: f64,
    wn_t_simulated: f64,
}

/// Predicted limits as lines, simulated ones as diamonds.
pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Figure>(FILE)?;
    let loops = loops();
    let found: Vec<_> = figures.rows.chunks((figures.rows.len() / loops.len()).max(1)).collect();
    let (dampings, masses) = loops.split_at(DAMPING_RATIOS.len());
    let (found_of_dampings, found_of_masses) = found.split_at(DAMPING_RATIOS.len());
    let panels = [
        lines(dampings, found_of_dampings, |sampled| format!("damping ratio {}", sampled.damping_ratio)),
        lines(masses, found_of_masses, |sampled| format!("{} of the modelled mass", sampled.mass_ratio)),
    ];
    let y_labels = ["largest wn T, mass as modelled", "largest wn T, damping ratio 1"];
    let panels = panels.iter().zip(y_labels).map(|(lines, y_label)| Panel {
        y_label,
        series: lines
            .iter()
            .enumerate()
            .flat_map(|(color, (label, predicted, found))| {
                let series = move |label, points| Series { label, points, style: LineStyle::Solid, color };
                let marks = found.iter().map(move |mark| series("", &mark[..]));
                [series(label, &predicted[..])].into_iter().chain(marks)
            })
            .collect(),
    });
    let title = figures.titled("Stability limit of the sampled loop: lines predicted, diamonds simulated");
    let x_label = "from measurement to force [periods]";
    write_svg(&charts.path("stability_sampled.svg"), &title, x_label, &panels.collect::<Vec<_>>())?;
    Ok(())
}

/// Label, predicted line and diamonds of each loop.
fn lines(
    loops: &[SampledLoop],
    found: &[&[Figure]],
    label: fn(&SampledLoop) -> String,
) -> Vec<(String, Vec<At>, Vec<Vec<At>>)> {
    let predict = |sampled: &SampledLoop| -> Vec<At> {
        let limit = |delay_periods| SampledLoop { delay_periods, ..*sampled }.largest_wn_t();
        delays(PREDICTED).into_iter().map(|delay| (delay, limit(delay))).collect()
    };
    let predicted: Vec<_> = loops.iter().map(predict).collect();
    let largest = predicted.iter().flatten().map(|(_, wn_t)| *wn_t).fold(0.0, f64::max);
    let mark = |row: &Figure| diamond((row.delay_periods, row.wn_t_simulated), MARK.0, MARK.1 * largest);
    let lines = loops.iter().zip(predicted).zip(found);
    lines.map(|((sampled, line), rows)| (label(sampled), line, rows.iter().map(mark).collect())).collect()
}

/// From none to the longest.
fn delays(per_period: u32) -> Vec<f64> {
    (0..=MAX_DELAY_PERIODS * per_period).map(|k| f64::from(k) / f64::from(per_period)).collect()
}

fn diamond((x, y): At, dx: f64, dy: f64) -> Vec<At> {
    vec![(x - dx, y), (x, y + dy), (x + dx, y), (x, y - dy), (x - dx, y)]
}
