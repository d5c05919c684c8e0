//! Our loop against cyclictest, and how many platforms it carries: `cargo bench --bench loop_latency`.
//!
//! The daemon runs in its real form, `hexad run` with its ports and threads, once released by sleeping and once
//! by `hybrid`. Both it and cyclictest sleep with `clock_nanosleep` until points of an absolute grid, note how
//! much later they look at the clock, and leave out the points that have passed by then. What makes the
//! comparison fair:
//!
//! - Short rounds in turn, who begins changes, many times over the run: a phase of the host hits all. Quantiles
//!   are medians over the rounds; the curves, p99.99, maxima and counts are of all rounds together.
//! - The same processor, FIFO priority, period, phase of the grid (half a period), and locked memory. Both ask
//!   for no idle state but the shallowest (`/dev/cpu_dma_latency` at 0, the default of both).
//! - The same threshold for a miss, applied to the same kind of data. cyclictest's histogram has nanoseconds and
//!   ends at 1 ms; ours has three digits.
//! - The driver, a light thread that publishes a moving setpoint and measured lengths at the loop's rate, runs in
//!   the rounds of cyclictest too. The daemon does not: whatever its io thread, on the other processor, costs
//!   the loop counts against us. The daemon is in control throughout, or the bench fails.
//! - Under load, `stress-ng` computes, moves memory and switches contexts on every processor. Where others use
//!   the machine, "idle" means as idle as they leave it.
//!
//! The real-time processor is the last that this process may use, the helpers' the first. Release to force
//! visible is in rounds of its own (`subscriber.rs`), sizes are in `size.rs`. Files: `loop_latency.csv` and
//! `.svg`, `loop_latency_distribution.csv`, `loop_size.csv` and `.svg` in `benches/charts`.
//!
//! Needs root or the right to FIFO priority, two processors, cyclictest, stress-ng and strace; names what is
//! missing and ends with 2. `-- --quick` takes one short round of everything: within 60 s instead of 12 min.
//! `-- --redraw` measures nothing and draws the charts from the CSV files.

mod chart;
mod contest;
mod distribution;
mod driver;
mod fleet;
mod load;
mod results;
mod rig;
mod size;
mod subscriber;
mod summary;
#[path = "../support/mod.rs"]
mod support;
mod syscalls;
mod tools;

use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};

use contest::{Contestant, Watch};
use distribution::Distribution;
use driver::Driver;
use load::Load;
use results::Row;
use rig::{Release, Rig};
use size::{Effort, Size, Unit};
use support::Failure;

/// Rates of the loop \[Hz\].
const RATES: [u32; 5] = [250, 1000, 4000, 10_000, 20_000];

/// Rates at which a subscriber polls \[Hz\].
const SEEN_RATES: [u32; 2] = [1000, 4000];

/// Exit code where something that the bench needs is missing.
const CANNOT_BEGIN: u8 = 2;

/// How much is measured.
#[derive(Clone, Copy)]
struct Plan {
    rounds: usize,
    /// Length of a round \[s\].
    seconds: f64,
    sizes: Effort,
}

/// 500 wake-ups a round at the lowest rate, so that its p99 is not a single one.
const FULL: Plan = Plan { rounds: 5, seconds: 2.0, sizes: Effort { repetitions: 3, seconds: 0.5 } };
const QUICK: Plan = Plan { rounds: 1, seconds: 0.3, sizes: Effort { repetitions: 1, seconds: 0.1 } };

/// Everything that was measured.
struct Measured {
    rows: Vec<Row>,
    sizes: Vec<Size>,
    /// Single steps of the controller.
    steps: Distribution,
    /// System calls of the real-time thread.
    calls: Vec<(String, u64)>,
}

/// Timing of the loop against cyclictest, and against its own size.
#[derive(Parser)]
struct Arguments {
    /// One short round of everything: within 60 s.
    #[arg(long)]
    quick: bool,
    /// Measures nothing and draws the charts from the CSV files.
    #[arg(long)]
    redraw: bool,
    /// What `cargo bench` adds.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let plan = if arguments.quick { QUICK } else { FULL };
    let (outcome, code) = match Rig::new() {
        _ if arguments.redraw => (draw(), ExitCode::FAILURE),
        Ok(rig) => (run(&rig, plan), ExitCode::FAILURE),
        Err(failure) => (Err(failure), ExitCode::from(CANNOT_BEGIN)),
    };
    outcome.map_or_else(
        |failure| {
            eprintln!("{failure}");
            code
        },
        |()| ExitCode::SUCCESS,
    )
}

fn run(rig: &Rig, plan: Plan) -> Result<(), Failure> {
    let begin = Instant::now();
    let mut rows = rows();
    let mut watch = Watch::new(1)?;
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} rounds, {eta} left")?;
    let bar = ProgressBar::new((plan.rounds * rows.len()) as u64).with_style(style);
    for round in 0..plan.rounds {
        take_all(rig, &mut watch, &mut rows, round, plan.seconds, &bar)?;
    }
    bar.finish_and_clear();
    let spinner = ProgressBar::new_spinner();
    spinner.enable_steady_tick(Duration::from_millis(100));
    let steps = fleet::steps(rig)?;
    let calls = syscalls::of_the_loop(rig, &mut watch, Release::Hybrid)?;
    let sizes = sizes(rig, plan.sizes, &spinner)?;
    spinner.finish_and_clear();

    let measured = Measured { rows, sizes, steps, calls };
    summary::print(&measured);
    println!("\n{} rounds of {} s each, {:.0} s", plan.rounds, plan.seconds, begin.elapsed().as_secs_f64());
    if cfg!(debug_assertions) {
        println!("a debug build: these times mean nothing and nothing was written; use cargo bench");
        return Ok(());
    }
    write(&measured)
}

/// What is measured; those that are compared are side by side.
fn rows() -> Vec<Row> {
    let row = |rate_hz, loaded, contestant, seen| Row { rate_hz, loaded, contestant, seen, rounds: vec![] };
    let mut rows = vec![];
    for rate_hz in RATES {
        for loaded in [false, true] {
            rows.extend(Contestant::ALL.map(|contestant| row(rate_hz, loaded, contestant, false)));
        }
    }
    for rate_hz in SEEN_RATES {
        let releases = [Release::Sleep, Release::Hybrid];
        rows.extend(releases.map(|release| row(rate_hz, false, Contestant::Hexad(release), true)));
    }
    rows
}

/// One round of each row; within a group another one begins each time.
fn take_all(
    rig: &Rig,
    watch: &mut Watch,
    rows: &mut [Row],
    round: usize,
    seconds: f64,
    bar: &ProgressBar,
) -> Result<(), Failure> {
    for group in rows.chunk_by_mut(Row::compares_with) {
        let Some(Row { loaded, rate_hz, .. }) = group.first() else { continue };
        let _load = loaded.then(|| Load::start(rig)).transpose()?;
        let _driver = Driver::start(rig, 1, *rate_hz)?;
        let turn = round % group.len();
        group.rotate_left(turn);
        for row in &mut *group {
            take(rig, watch, row, seconds)?;
            bar.inc(1);
        }
        group.rotate_right(turn);
    }
    Ok(())
}

fn take(rig: &Rig, watch: &mut Watch, row: &mut Row, seconds: f64) -> Result<(), Failure> {
    let context =
        |failure| format!("{} Hz, {}, {}: {failure}", row.rate_hz, row.load(), row.contestant.name());
    let round = match row.contestant {
        Contestant::Hexad(release) if row.seen => {
            contest::round_seen(rig, watch, release, row.rate_hz, seconds)
        }
        contestant => contest::round(rig, watch, contestant, row.rate_hz, seconds),
    };
    row.rounds.push(round.map_err(context)?);
    Ok(())
}

fn sizes(rig: &Rig, effort: Effort, spinner: &ProgressBar) -> Result<Vec<Size>, Failure> {
    let mut sizes = vec![];
    for unit in [Unit::Platforms, Unit::Daemons] {
        for rate_hz in size::RATES {
            spinner.set_message(format!("{} at {rate_hz} Hz", unit.name()));
            sizes.extend(size::search(rig, unit, rate_hz, effort)?);
        }
    }
    Ok(sizes)
}

fn write(measured: &Measured) -> Result<(), Failure> {
    results::write_csv(&measured.rows)?;
    results::write_distributions(&measured.rows)?;
    size::write_csv(&measured.sizes, &measured.steps)?;
    draw()
}

fn draw() -> Result<(), Failure> {
    chart::draw()?;
    size::draw()
}
