//! What control a scene needs: `cargo bench --bench closed_loop` (2 min).
//!
//! The controller against the simulated hardware, in one process and in simulated time, on the fast scene of a
//! machine: tracking error against compute time for every control mode, model and rate; and against payload,
//! friction, noise and dead time, with and without compensation of disturbances. Writes `benches/charts/closed_loop_*.csv` and
//! `.svg`. `-- --redraw` measures nothing and draws the charts from the CSV files; `-- --quick` takes few of each.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests, of which this bench uses a part"
)]

mod disturbances;
mod rates;
mod run;
#[path = "../support/mod.rs"]
mod support;

use std::process::ExitCode;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use run::{Outcome, Run};
use support::charts::Charts;
use support::{ChartArguments, Failure, cells, exit_code};

fn main() -> ExitCode {
    exit_code(run(&ChartArguments::parse()))
}

fn run(arguments: &ChartArguments) -> Result<(), Failure> {
    let charts = arguments.charts();
    if !arguments.redraw {
        rates::run(&charts, arguments.extent.is_quick())?;
        disturbances::run(&charts, arguments.extent.is_quick())?;
    }
    rates::draw(&charts)?;
    disturbances::draw(&charts)
}

/// All runs, on all processors, with their outcomes in the same order.
fn play(what: &str, runs: &[Run]) -> Vec<Outcome> {
    let bar = ProgressBar::new(runs.len() as u64);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(what.to_owned());
    let outcomes = runs.par_iter().map(|run| (run.play(), bar.inc(1)).0).collect();
    bar.finish_and_clear();
    outcomes
}

/// Names of the modes in a legend, in the order of the palette.
const MODES: [&str; 4] = ["computed torque", "feedforward + joint PD", "gravity + joint PD", "joint PD"];
