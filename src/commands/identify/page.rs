//! Page of an identification: facts, change of each parameter, forces and residuals with the file and with the result.

use std::collections::BTreeMap;

use serde::Serialize;

use super::report::{IdentificationReport, Row};
use crate::commands::report::head::{LevelHead, json};
use crate::commands::report::summary::{Fact, plain_text};
use crate::output::page::{PageKind, page};
use hexad_core::model::LEGS;
use hexad_core::model::machine::Machine;
use hexad_machine::analysis::identification::{Run, predictions};

/// Longest time of motions that a page shows \[s\], as half a megabyte.
const MAX_SHOWN_S: f64 = 300.0;

/// Columns: recorded force of each leg, and predictions with the file and with the result; both residuals.
const COLUMNS: usize = 5 * LEGS;
const SIGNALS: [(&str, usize); LEGS + 2] = [
    ("leg_1", 0),
    ("leg_2", 3),
    ("leg_3", 6),
    ("leg_4", 9),
    ("leg_5", 12),
    ("leg_6", 15),
    ("residual_before", 3 * LEGS),
    ("residual_after", 4 * LEGS),
];

/// Head of a page.
#[derive(Serialize)]
struct Head<'a> {
    name: &'a str,
    facts: Vec<Fact>,
    parameters: Vec<Parameter>,
    /// Motion of the residuals.
    motion: &'static str,
    /// Cells of the residuals of each leg, as in the text, and the correlation of successive ones.
    residuals: Vec<Vec<String>>,
    /// Residuals with the result over length and over rate of each leg: place, mean and its deviation in each bin.
    dependence: Vec<[Vec<[f64; 3]>; 2]>,
    period_s: f64,
    length_s: f64,
    /// First column of each signal.
    columns: BTreeMap<&'static str, usize>,
    column_count: usize,
    levels: Vec<LevelHead>,
}

/// Change of a parameter.
#[derive(Serialize)]
struct Parameter {
    /// Name, and cells as in the text.
    cells: Vec<String>,
    /// Change from the file and its deviation, over the deviation that was expected.
    change: f64,
    deviation: f64,
    is_shown: bool,
}

impl From<(String, &Row)> for Parameter {
    fn from((name, row): (String, &Row)) -> Self {
        let [change, deviation] = row.change();
        let cells = [vec![name], row.cells().into()].concat();
        Self { cells, change, deviation, is_shown: row.is_shown }
    }
}

/// Text of a page. `machines`: of the file, and identified; `predicted`: the runs of the residuals.
pub(super) fn text(report: &IdentificationReport, machines: [&Machine; 2], predicted: &[Run]) -> String {
    let mut facts = report.facts();
    let (mut levels, mut samples, mut length_s, mut total_s) = (vec![], vec![], 0.0, 0.0);
    for run in predicted.iter().filter(|run| run.duration_s() > 0.0) {
        let mut level = Level::new(run, machines);
        total_s += level.step * level.count as f64;
        level.count = level.count.min(((MAX_SHOWN_S - length_s) / level.step) as usize);
        if level.count > 0 {
            samples.extend(level.bytes());
            levels.push(LevelHead { from: length_s, step: level.step, samples: level.count as u64 });
            length_s += level.step * level.count as f64;
        }
    }
    if total_s > MAX_SHOWN_S {
        let text = format!("the first {length_s:.0} s of {total_s:.0} s");
        facts.push(Fact { name: "Shown", text, is_bad: false });
    }
    let title = format!("{}: identification", report.machine);
    let summary = plain_text(&title, &facts);
    let correlated = report.residual_cells().into_iter().zip(report.correlation);
    let head = json(&Head {
        name: &report.machine,
        facts,
        parameters: report.rows().map(Parameter::from).collect(),
        motion: report.predicted_motion(),
        residuals: correlated
            .map(|(cells, correlation)| [cells.to_vec(), vec![format!("{correlation:.2}")]].concat())
            .collect(),
        dependence: dependence(machines[1], predicted),
        period_s: levels.first().map_or(1.0, |level: &LevelHead| level.step),
        length_s,
        columns: SIGNALS.into(),
        column_count: COLUMNS,
        levels,
    });
    page(PageKind::Identification, &title, &summary, &head, &samples)
}

/// Bins of a length or a rate, and least number of residuals in a bin that is shown.
const BINS: usize = 24;
const LEAST_IN_BIN: f64 = 5.0;

/// Means of the residuals of each leg in bins of its length and of its rate.
fn dependence(machine: &Machine, runs: &[Run]) -> Vec<[Vec<[f64; 3]>; 2]> {
    let all: Vec<_> = runs.iter().flat_map(|run| predictions(machine, run)).collect();
    let bins = |leg: usize, of: fn(&[f64; 2]) -> f64| {
        let points =
            || all.iter().filter(|each| each.leg == leg).map(|each| (of(&each.motion), each.residual_n));
        let (least, most) =
            points().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (x, _)| (a.min(x), b.max(x)));
        let width = (most - least) / BINS as f64;
        let mut sums = [[0.0; 3]; BINS];
        for (x, residual) in points() {
            if let Some([count, sum, squares]) = sums.get_mut((((x - least) / width) as usize).min(BINS - 1))
            {
                (*count, *sum, *squares) = (*count + 1.0, *sum + residual, *squares + residual * residual);
            }
        }
        let shown = sums.into_iter().enumerate().filter(|(_, [count, ..])| *count >= LEAST_IN_BIN);
        let bin = |(index, [count, sum, squares]): (usize, [f64; 3])| {
            let mean = sum / count;
            let deviation = ((squares / count - mean * mean).max(0.0) / count).sqrt();
            [least + (index as f64 + 0.5) * width, mean, deviation]
        };
        shown.map(bin).collect::<Vec<_>>()
    };
    (0..LEGS).map(|leg| [bins(leg, |[length, _]| *length), bins(leg, |[_, rate]| *rate)]).collect()
}

/// Samples of a run, column by column, on a grid of equal steps.
struct Level {
    step: f64,
    count: usize,
    columns: [Vec<f32>; COLUMNS],
}

impl Level {
    fn new(run: &Run, [file, identified]: [&Machine; 2]) -> Self {
        let step = run.group_s();
        let first_s = run.samples.first().map_or(0.0, |sample| sample.time_s);
        // One more without values: no line leads to the next run.
        let count = (run.duration_s() / step).ceil() as usize + 1;
        let mut columns = core::array::from_fn(|_| vec![f32::NAN; count]);
        for (before, after) in predictions(file, run).iter().zip(predictions(identified, run)) {
            let index = ((before.time_s - first_s) / step) as usize;
            let forces =
                [before.command_n, before.command_n - before.residual_n, after.command_n - after.residual_n];
            let leg = before.leg;
            let of_leg = forces.into_iter().enumerate().map(|(k, force)| (3 * leg + k, force));
            let residuals = [(3 * LEGS + leg, before.residual_n), (4 * LEGS + leg, after.residual_n)];
            for (column, number) in of_leg.chain(residuals) {
                if let Some(place) =
                    columns.get_mut(column).and_then(|column: &mut Vec<f32>| column.get_mut(index))
                {
                    *place = number as f32;
                }
            }
        }
        Self { step, count, columns }
    }

    /// Little-endian numbers of four bytes.
    fn bytes(&self) -> impl Iterator<Item = u8> {
        self.columns.iter().flat_map(|column| column.iter().take(self.count)).flat_map(|x| x.to_le_bytes())
    }
}
