//! Where forward kinematics fails, ours and others': `cargo bench --bench stability` (3 min).
//!
//! Success from home against the spread of the poses; error against time for 1, 2, 3 ... steps; what one step of
//! Newton's method per cycle costs at two rates; where the sampled loop turns unstable; and a million trials in
//! which ours must not be deceived. Writes `benches/charts/stability_*.csv` and `.svg`. `-- --quick` makes a
//! twentieth of the trials; `-- --redraw` measures no times, makes no trials and draws the charts from the CSV files.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests, of which this bench uses a part"
)]

mod cycles;
mod maps;
mod sampled;
mod speed;
#[path = "../support/mod.rs"]
mod support;
#[path = "../speed_accuracy/timing.rs"]
mod timing;

use std::process::ExitCode;

use clap::Parser;

use hexad_support::stability::{delayed, rivals, trials};
use support::charts::Charts;
use support::{ChartArguments, Failure, cells, exit_code};

/// The machines that are looked at.
const MACHINES: [&str; 3] = ["fried2008", "tsai2000", "motion_base"];

fn main() -> ExitCode {
    exit_code(run(&ChartArguments::parse()))
}

fn run(arguments: &ChartArguments) -> Result<(), Failure> {
    let charts = arguments.charts();
    let quick = arguments.extent.is_quick();
    if !arguments.redraw {
        speed::run(&charts, quick)?;
        sampled::run(&charts, quick)?;
        maps::run(&charts, if quick { 100 } else { 1 })?;
    }
    // Takes no time, and its file has not all that is drawn.
    cycles::run(&charts)?;
    speed::draw(&charts)?;
    sampled::draw(&charts)?;
    maps::draw(&charts)
}
