//! Where forward kinematics fails, ours and others': `cargo bench --bench stability` (3 min).
//!
//! Success from home against the spread of the poses; error against time for 1, 2, 3 ... steps; what one step of
//! Newton's method per cycle costs at two rates; where the sampled loop turns unstable; and a million trials in
//! which ours must not be deceived. Writes `benches/charts/stability_*.csv` and `.svg`. `-- --quick` makes a
//! twentieth of the trials.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests, of which this bench uses a part"
)]

#[path = "../../tests/common/mod.rs"]
mod common;
mod cycles;
mod maps;
mod sampled;
mod speed;
#[path = "../speed_accuracy/timing.rs"]
mod timing;

use common::stability::{delayed, rivals, trials};

use std::error::Error;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use hexad::host::files::write_whole;

/// Anything that ends the run.
type Failure = Box<dyn Error>;

/// The machines that are looked at.
const MACHINES: [&str; 3] = ["fried2008", "tsai2000", "motion_base"];

fn main() -> Result<(), Failure> {
    let quick = std::env::args().any(|argument| argument == "--quick");
    speed::run()?;
    cycles::run()?;
    sampled::run()?;
    maps::run(if quick { 20 } else { 1 })
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
