//! The longest cycle of the controller against the median, in instructions: `cargo bench --bench longest_cycle` (5 min).
//!
//! The runs of `tests/adversary`, at 1 kHz and faster: a search climbs for the longest cycle, with each policy on a processor of
//! its own, from the longest that are known (`longest.txt`). Times decide which cycles of a run are counted, instructions which
//! runs it climbs from. The median is that of the fast scene of the same machine, at 1 kHz. `-- --seconds N` searches for as long,
//! `-- --machine NAME` with one machine only, `-- --quick` for one run after the known ones of the first machine; `HEXAD_SEED` begins elsewhere;
//! `-- --genome LINE` counts one run. With `RUSTFLAGS="-C target-cpu=x86-64-v3"` the counts are those of that instruction set.
//! Where the system lets no child be traced, nothing is counted.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests, of which this bench uses a part"
)]

mod count;
mod search;
#[path = "../support/mod.rs"]
mod support;
mod usual;

use std::env;
use std::process::ExitCode;
use std::thread::scope;
use std::time::Duration;

use clap::Parser;
use hexad::control::parameters::ViolationPolicy;
use hexad::realtime::setup::denormals;
use indicatif::{ProgressBar, ProgressStyle};

use hexad_support::search::genome::Genome;
use hexad_support::search::machines::MACHINES;
use search::Search;
use support::omissions::Omissions;
use support::{Extent, Failure, exit_code};

/// Time of the search with each policy where none is given \[s\].
const SECONDS: f64 = 240.0;
const QUICK_SECONDS: f64 = 0.0;
/// Cycles of the fast scene of which the median is taken.
const COUNTED: usize = 25;
const QUICK_COUNTED: usize = 3;

/// The longest cycle of the controller against the median, in instructions.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    of_all: Extent,
    /// Time of the search [s].
    #[arg(long)]
    seconds: Option<f64>,
    /// One machine of tests/data; all if absent, of a quick run the first.
    #[arg(long, value_parser = machine)]
    machine: Option<usize>,
    /// Counts one run, a line of `longest.txt`.
    #[arg(long, value_parser = genome)]
    genome: Option<Genome>,
}

fn machine(name: &str) -> Result<usize, &'static str> {
    MACHINES.iter().position(|machine| *machine == name).ok_or("no machine of tests/data")
}

fn genome(line: &str) -> Result<Genome, &'static str> {
    Genome::parse(line).ok_or("not a genome")
}

fn main() -> ExitCode {
    exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut omissions = Omissions::default();
    match count::require_tracing() {
        Ok(()) => find_longest(arguments)?,
        Err(errno) => omissions.lacking("instructions", format!("no right to trace a child: {errno}")),
    }
    omissions.finish()
}

fn find_longest(arguments: &Arguments) -> Result<(), Failure> {
    denormals::flush();
    let quick = arguments.of_all.is_quick();
    let (seconds, counted) = if quick { (QUICK_SECONDS, QUICK_COUNTED) } else { (SECONDS, COUNTED) };
    if let Some(genome) = &arguments.genome {
        let mut search = Search::new();
        search.run(genome);
        report(&search, counted);
        return Ok(());
    }
    let seconds = arguments.seconds.unwrap_or(seconds);
    let machines = match arguments.machine.or(quick.then_some(0)) {
        Some(index) => index..index + 1,
        None => 0..MACHINES.len(),
    };
    let time = Duration::from_secs_f64(seconds);
    let seed = env::var("HEXAD_SEED").map_or(Ok(1), |text| text.parse())?;
    let progress = ProgressBar::new_spinner().with_message(format!("search of {seconds} s"));
    progress.set_style(ProgressStyle::with_template("{spinner} {msg}, {elapsed}")?);
    progress.enable_steady_tick(Duration::from_millis(200));
    let searches = scope(|scope| {
        let searches = [ViolationPolicy::Stop, ViolationPolicy::Limit].map(|policy| {
            let machines = machines.clone();
            scope.spawn(move || Search::climb(policy, machines, seed, time))
        });
        searches.map(|search| search.join().expect("a search that ends"))
    });
    progress.finish_and_clear();
    searches.iter().for_each(|search| report(search, counted));
    Ok(())
}

/// A line for the longest cycle of each machine; the median is that of so many cycles.
fn report(search: &Search, counted: usize) {
    let mut lines = vec![format!("{} cycles", search.cycles)];
    let mut machines = vec![];
    for found in &search.found {
        let (genome, [before, after]) = (&found.genome, found.states);
        if machines.contains(&genome.machine) {
            continue;
        }
        machines.push(genome.machine);
        let median = usual::median(genome.machine, genome.policy, counted);
        lines.push(format!(
            "{:?}, {}: {} instructions, {:.2} times the median of {median}; {before:?} to {after:?}, cycle {} of {genome}",
            genome.policy,
            MACHINES[genome.machine],
            found.instructions,
            found.instructions as f64 / median as f64,
            found.cycle,
        ));
    }
    println!("{}", lines.join("\n"));
}
