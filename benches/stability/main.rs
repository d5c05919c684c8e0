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

#[path = "../../tests/common/mod.rs"]
mod common;
mod cycles;
mod maps;
mod sampled;
mod speed;
#[path = "../support/mod.rs"]
mod support;
#[path = "../speed_accuracy/timing.rs"]
mod timing;

use common::stability::{delayed, rivals, trials};

use support::{Failure, cells, chart, write_csv};

/// The machines that are looked at.
const MACHINES: [&str; 3] = ["fried2008", "tsai2000", "motion_base"];

fn main() -> Result<(), Failure> {
    let has = |flag: &str| std::env::args().any(|argument| argument == flag);
    if !has("--redraw") {
        speed::run()?;
        sampled::run()?;
        maps::run(if has("--quick") { 20 } else { 1 })?;
    }
    // Takes no time, and its file has not all that is drawn.
    cycles::run()?;
    speed::draw()?;
    sampled::draw()?;
    maps::draw()
}
