//! The longest cycles that a search has found, replayed and counted in instructions, on the code that ships.
//!
//! The search is `benches/longest_cycle`; its file names the runs and the cycle of each.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests"
)]

use hexad::control::controller::Controller;
use hexad::control::parameters::ViolationPolicy;
use hexad::realtime::setup::denormals;

use hexad_support::not_run::lacking;
use hexad_support::search::genome::Genome;
use hexad_support::search::machines::MACHINES;
use hexad_support::search::run;

#[path = "../benches/longest_cycle/count.rs"]
mod count;
#[path = "../benches/longest_cycle/usual.rs"]
mod usual;

const LONGEST: &str = include_str!("../benches/longest_cycle/longest.txt");

/// Bounds of any cycle: instructions, and their ratio to the median of the fast scene of the same machine. Built for x86-64-v3 the
/// same cycles have 5 to 10 % fewer; there the bound of the project is 33,000.
const MAX_INSTRUCTIONS: u64 = 37_000;
const MAX_MEDIANS: f64 = 3.2;
/// Cycles of which a median is taken.
const COUNTED: usize = 5;

/// Instructions of one cycle of a run.
fn instructions(genome: &Genome, cycle: usize) -> u64 {
    let (mut number, mut before, mut counted): (_, Option<Controller>, _) = (0, None, None);
    run::run_with(genome, None, |observed, input, _| {
        if number == cycle {
            counted = before.take().map(|before| count::instructions(&before, input));
        }
        before = (number + 1 == cycle).then(|| observed.controller.clone());
        number += 1;
    });
    counted.unwrap_or_else(|| panic!("no cycle {cycle} of {number}: {genome}"))
}

#[test]
fn the_longest_cycles_that_are_known_stay_within_their_bounds() {
    if let Err(errno) = count::require_tracing() {
        return lacking(&format!("the right to trace a child: {errno}"));
    }
    denormals::flush();
    let runs: Vec<_> = LONGEST.lines().filter_map(|line| Some((Genome::parse(line)?, line))).collect();
    for policy in [ViolationPolicy::Stop, ViolationPolicy::Limit] {
        let (genome, line) = runs.iter().find(|(genome, _)| genome.policy == policy).expect("a run");
        let cycle = line.rsplit_once(" cycle ").expect("its longest cycle").1.parse().unwrap();
        let (longest, median) =
            (instructions(genome, cycle), usual::median(genome.machine, genome.policy, COUNTED));
        let ratio = longest as f64 / median as f64;
        let what = format!(
            "{}, {:?}: {longest} instructions, {ratio:.2} medians",
            MACHINES[genome.machine], genome.policy
        );
        println!("{what}");
        assert!(longest <= MAX_INSTRUCTIONS && ratio <= MAX_MEDIANS, "{what}");
    }
}
