//! The longest cycle of the controller against the median, in instructions: `cargo bench --bench longest_cycle` (5 min).
//!
//! The runs of `tests/adversary`, at 1 kHz and faster: a search climbs for the longest cycle, with each policy on a processor of
//! its own, from the longest that are known (`longest.txt`). Times decide which cycles of a run are counted, instructions which
//! runs it climbs from. The median is that of the fast scene of the same machine, at 1 kHz. `-- --seconds N` searches for as long,
//! `-- --machine NAME` with one machine only; `HEXAD_SEED` begins elsewhere; `-- --genome LINE` counts one run. With
//! `RUSTFLAGS="-C target-cpu=x86-64-v3"` the counts are those of that instruction set.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests, of which this bench uses a part"
)]

#[path = "../../tests/common/mod.rs"]
mod common;
mod count;
#[path = "../../tests/adversary/genome.rs"]
mod genome;
#[path = "../../tests/adversary/machines.rs"]
mod machines;
#[path = "../../tests/adversary/messages.rs"]
mod messages;
#[path = "../../tests/adversary/run.rs"]
mod run;
#[path = "../../tests/adversary/scenario.rs"]
mod scenario;
mod search;
#[path = "../../tests/adversary/stream.rs"]
mod stream;
mod usual;

use std::env;
use std::error::Error;
use std::thread::scope;
use std::time::Duration;

use hexad::control::parameters::ViolationPolicy;
use hexad::realtime::setup::denormals;
use indicatif::{ProgressBar, ProgressStyle};

use genome::Genome;
use machines::MACHINES;
use search::Search;

/// Time of the search with each policy where none is given \[s\].
const SECONDS: f64 = 240.0;

fn main() -> Result<(), Box<dyn Error>> {
    denormals::flush();
    let value = |flag: &str| env::args().skip_while(|argument| argument != flag).nth(1);
    if let Some(line) = value("--genome") {
        let genome = Genome::parse(&line).ok_or("not a genome")?;
        let mut search = Search::new();
        search.run(&genome);
        report(&search);
        return Ok(());
    }
    let seconds = value("--seconds").map_or(Ok(SECONDS), |text| text.parse())?;
    let machines = match value("--machine") {
        Some(name) => {
            let index =
                MACHINES.iter().position(|machine| *machine == name).ok_or("no machine of tests/data")?;
            index..index + 1
        }
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
    searches.iter().for_each(report);
    Ok(())
}

/// A line for the longest cycle of each machine.
fn report(search: &Search) {
    let mut lines = vec![format!("{} cycles", search.cycles)];
    let mut machines = vec![];
    for found in &search.found {
        let (genome, [before, after]) = (&found.genome, found.states);
        if machines.contains(&genome.machine) {
            continue;
        }
        machines.push(genome.machine);
        let median = usual::median(genome.machine, genome.policy);
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
