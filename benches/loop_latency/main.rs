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
//!   the loop counts against us. The daemon is in control throughout, or the round is left out.
//! - Under load, `stress-ng` computes, moves memory and switches contexts on every processor. Where others use
//!   the machine, "idle" means as idle as they leave it.
//!
//! The real-time processor is the last that this process may use, the helpers' the first. Release to force
//! visible is in rounds of its own (`subscriber.rs`), sizes are in `size.rs`. Files: `loop_latency.csv` and
//! `.svg`, `loop_latency_distribution.csv`, `loop_size.csv` and `.svg` in `benches/charts`.
//!
//! Needs root or the right to FIFO priority, two processors, cyclictest, stress-ng and strace. What is not measured
//! for want of one of them, or because the host disturbed it, is named with its reason and left out of the files.
//! `-- --quick` takes one short round of everything at one rate; `-- --redraw` measures nothing and draws the charts
//! from the CSV files.

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

use contest::Contestant;
use distribution::Distribution;
use driver::Driver;
use load::Load;
use results::Row;
use rig::{PRIORITY, Release, Rig};
use size::{Effort, Size, Unit};
use support::charts::Charts;
use support::omissions::Omissions;
use support::{ChartArguments, Failure, exit_code};
use tools::Tool;

/// How much is measured.
#[derive(Clone, Copy)]
struct Plan {
    /// Rates of the loop \[Hz\].
    rates: &'static [u32],
    /// Rates at which a subscriber polls \[Hz\].
    seen_rates: &'static [u32],
    rounds: usize,
    /// Length of a round \[s\].
    seconds: f64,
    sizes: Effort,
}

/// 500 wake-ups a round at the lowest rate, so that its p99 is not a single one.
const FULL: Plan = Plan {
    rates: &[250, 1000, 4000, 10_000, 20_000],
    seen_rates: &[1000, 4000],
    rounds: 5,
    seconds: 2.0,
    sizes: Effort {
        rates: &size::RATES,
        repetitions: 3,
        seconds: 0.5,
        most_platforms: 8192,
        most_daemons: 32,
    },
};
const QUICK: Plan = Plan {
    rates: &[1000],
    seen_rates: &[1000],
    rounds: 1,
    seconds: 0.2,
    sizes: Effort { rates: &[1000], repetitions: 1, seconds: 0.1, most_platforms: 128, most_daemons: 2 },
};

/// Everything that was measured.
#[derive(Default)]
struct Measured {
    /// Those with at least one round.
    rows: Vec<Row>,
    sizes: Vec<Size>,
    /// Single steps of the controller; empty if they were not measured.
    steps: Distribution,
    /// System calls of the real-time thread; empty if they were not counted.
    calls: Vec<(String, u64)>,
}

fn main() -> ExitCode {
    exit_code(run(&ChartArguments::parse()))
}

fn run(arguments: &ChartArguments) -> Result<(), Failure> {
    let charts = arguments.charts();
    if arguments.redraw {
        chart::draw(&charts)?;
        return size::draw(&charts);
    }
    let begin = Instant::now();
    let plan = if arguments.extent.is_quick() { QUICK } else { FULL };
    let mut omissions = Omissions::default();
    match tools::require_realtime(PRIORITY).and_then(|()| tools::processors()) {
        Ok(processors) => {
            let measured = measure(&Rig::new(processors)?, plan, &mut omissions)?;
            summary::print(&measured);
            println!(
                "\n{} rounds of {} s each, {:.0} s",
                plan.rounds,
                plan.seconds,
                begin.elapsed().as_secs_f64()
            );
            write(&charts, &measured)?;
        }
        Err(failure) => omissions.lacking("everything", failure),
    }
    omissions.finish()
}

fn measure(rig: &Rig, plan: Plan, omissions: &mut Omissions) -> Result<Measured, Failure> {
    let missing: Vec<_> = Tool::ALL.into_iter().filter(|tool| !tool.is_there()).collect();
    for tool in &missing {
        let why = format!("no {}; install it with: apt-get install {}", tool.name(), tool.package());
        omissions.lacking(tool.part(), why);
    }
    let mut rows = rows(plan, &missing);
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} rounds, {eta} left")?;
    let bar = ProgressBar::new((plan.rounds * rows.len()) as u64).with_style(style);
    for round in 0..plan.rounds {
        take_all(rig, &mut rows, round, plan.seconds, &bar, omissions);
    }
    bar.finish_and_clear();
    rows.retain(|row| !row.rounds.is_empty());
    let spinner = ProgressBar::new_spinner();
    spinner.enable_steady_tick(Duration::from_millis(100));
    let steps = omissions.attempt("steps", "Controller::step", fleet::steps(rig)).unwrap_or_default();
    let mut calls = vec![];
    if !missing.contains(&Tool::Strace) {
        let counted = syscalls::of_the_loop(rig, Release::Hybrid);
        calls = omissions.attempt("system calls", Tool::Strace.part(), counted).unwrap_or_default();
    }
    let sizes = sizes(rig, plan.sizes, &spinner, omissions);
    spinner.finish_and_clear();
    Ok(Measured { rows, sizes, steps, calls })
}

/// What is measured with the tools that there are; those that are compared are side by side.
fn rows(plan: Plan, missing: &[Tool]) -> Vec<Row> {
    let row = |rate_hz, loaded, contestant, seen| Row { rate_hz, loaded, contestant, seen, rounds: vec![] };
    let mut rows = vec![];
    for rate_hz in plan.rates {
        for loaded in [false, true] {
            rows.extend(Contestant::ALL.map(|contestant| row(*rate_hz, loaded, contestant, false)));
        }
    }
    for rate_hz in plan.seen_rates {
        let releases = [Release::Sleep, Release::Hybrid];
        rows.extend(releases.map(|release| row(*rate_hz, false, Contestant::Hexad(release), true)));
    }
    rows.retain(|row| {
        let needs = |tool| match tool {
            Tool::Cyclictest => row.contestant == Contestant::Cyclictest,
            Tool::StressNg => row.loaded,
            Tool::Strace => false,
        };
        !missing.iter().any(|tool| needs(*tool))
    });
    rows
}

/// One round of each row; within a group another one begins each time.
fn take_all(
    rig: &Rig,
    rows: &mut [Row],
    round: usize,
    seconds: f64,
    bar: &ProgressBar,
    omissions: &mut Omissions,
) {
    for group in rows.chunk_by_mut(Row::compares_with) {
        let Some(row) = group.first() else { continue };
        let surroundings = surroundings(rig, row);
        let what = format!("{} Hz, {}, round {}", row.rate_hz, row.load(), round + 1);
        let Some(_running) = omissions.attempt("load and driver", what, surroundings) else { continue };
        let turn = round % group.len();
        group.rotate_left(turn);
        for row in &mut *group {
            let taken = contest::round(rig, row, seconds);
            let what = format!("{}, round {}", row.name(), round + 1);
            row.rounds.extend(omissions.attempt(row.contestant.name(), what, taken));
            bar.inc(1);
        }
        group.rotate_right(turn);
    }
}

/// The load, if any, and the driver of a group of rows.
fn surroundings(rig: &Rig, row: &Row) -> Result<(Option<Load>, Driver), Failure> {
    let load = row.loaded.then(|| Load::start(rig)).transpose()?;
    Ok((load, Driver::start(rig, 1, row.rate_hz)?))
}

fn sizes(rig: &Rig, effort: Effort, spinner: &ProgressBar, omissions: &mut Omissions) -> Vec<Size> {
    let mut sizes = vec![];
    for unit in [Unit::Platforms, Unit::Daemons] {
        for rate_hz in effort.rates {
            spinner.set_message(format!("{} at {rate_hz} Hz", unit.name()));
            sizes.extend(size::search(rig, unit, *rate_hz, effort, omissions));
        }
    }
    sizes
}

/// Files and charts of the parts that were measured.
fn write(charts: &Charts, measured: &Measured) -> Result<(), Failure> {
    if !measured.rows.is_empty() {
        results::write_csv(charts, &measured.rows)?;
        results::write_distributions(charts, &measured.rows)?;
        chart::draw(charts)?;
    }
    if !measured.sizes.is_empty() {
        size::write_csv(charts, &measured.sizes, &measured.steps)?;
        size::draw(charts)?;
    }
    Ok(())
}
