//! What control a scene needs: `cargo bench --bench closed_loop` (2 min).
//!
//! The controller against the simulated hardware, in one process and in simulated time, on the fast scene of a
//! machine: tracking error against compute time for every control mode, model and rate; and against payload,
//! friction, noise and dead time, with and without the observer. Writes `benches/charts/closed_loop_*.csv` and
//! `.svg`. `-- --quick` takes fewer of each.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests, of which this bench uses a part"
)]

#[path = "../../tests/common/mod.rs"]
mod common;
mod disturbances;
mod rates;
mod run;

use std::error::Error;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use hexad::output::files::write_whole;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use run::{Outcome, Run};

/// Anything that ends the bench.
type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let quick = std::env::args().any(|argument| argument == "--quick");
    rates::run(quick)?;
    disturbances::run(quick)
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

/// `benches/charts/NAME`
fn chart(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/charts").join(name)
}

/// A CSV file of numbers and names.
fn write_csv(name: &str, header: &[&str], rows: &[Vec<String>]) -> Result<(), Failure> {
    let mut csv = csv::Writer::from_writer(vec![]);
    csv.write_record(header)?;
    for row in rows {
        csv.write_record(row)?;
    }
    write_whole(&chart(name), &csv.into_inner()?)?;
    println!("written: {}", chart(name).display());
    Ok(())
}

fn cells<const N: usize>(cells: [&dyn Display; N]) -> Vec<String> {
    cells.map(ToString::to_string).into()
}

/// Names of the modes in a legend, in the order of the palette.
const MODES: [&str; 4] = ["computed torque", "feedforward + joint PD", "gravity + joint PD", "joint PD"];
