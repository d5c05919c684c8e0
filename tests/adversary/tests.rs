//! The tests: genomes that are known, the search, and that a genome is a run.

use std::collections::HashMap;
use std::path::Path;
use std::{env, fs};

use hexad::control::parameters::ViolationPolicy;
use hexad::model::random::Random;

use super::common::certificate::Certificate;
use super::common::extremes::Extremes;
use super::genome::{Genome, Sensors};
use super::machines::MACHINES;
use super::run::{run, run_with};
use super::scenario::Scenario;
use super::search::{Found, Search, search};
use super::{table, trace};

/// Cycles under control of each machine with each policy, beside those of the genomes that are known.
const CYCLES: u64 = 10_000;
const LONG_CYCLES: u64 = 1_000_000;
/// Genomes that are written of each policy and quantity.
const KEPT: u32 = 3;
/// Violations that are printed with what their genomes mean.
const EXPLAINED: usize = 3;

/// The genomes of `worst.txt`, which were the worst of their time.
fn known() -> Vec<Genome> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/adversary/worst.txt");
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| Genome::parse(line).unwrap_or_else(|| panic!("not a genome: {line}"))).collect()
}

/// Writes the worst genomes of each policy and quantity, over all machines.
fn keep(searches: &[Search], path: &str) {
    let mut all: Vec<_> = searches.iter().flat_map(Search::worst).collect();
    all.sort_by(|a, b| b.value.total_cmp(&a.value));
    let mut counts = HashMap::new();
    let mut lines: Vec<String> = Vec::new();
    for found in all {
        let count = counts.entry((found.genome.policy as u32, found.quantity as u32)).or_insert(0);
        *count += 1;
        let genome = found.genome.to_string();
        if *count <= KEPT && !lines.iter().any(|line| line.starts_with(&genome)) {
            lines.push(format!("{genome} # {} {:.6}\n", found.quantity.name(), found.value));
        }
    }
    let head = "# machine, policy, sensors, genes; quantity and value when it was found\n";
    fs::write(path, head.to_owned() + &lines.concat()).unwrap();
}

fn explain(violations: &[&Found]) -> String {
    let mut text = String::new();
    for found in violations {
        let (name, fault) = (found.quantity.name(), found.outcome.fault);
        text += &format!("{name} {:.4}, fault {fault:?}: {}\n", found.value, found.genome);
    }
    for found in violations.iter().take(EXPLAINED) {
        text += &format!(
            "{} {:.4}: {:?} {:#?}\n",
            found.quantity.name(),
            found.value,
            found.outcome.fault,
            Scenario::of(&found.genome)
        );
    }
    text
}

#[test]
fn certificate_no_search_finds_a_motion_beyond_a_limit() {
    let kinds = 2 * MACHINES.len() as u64;
    let certificate = Certificate::new("adversary", kinds * CYCLES, kinds * LONG_CYCLES);
    let cycles = certificate.total() / kinds;
    let searches = search(&known(), certificate.seed(), cycles, |done| certificate.advance(done));
    let rows: Vec<_> = searches.iter().map(|search| search.row.clone()).collect();
    println!("{}", table::text(&rows));
    if let Ok(path) = env::var("HEXAD_ADVERSARY_KEEP") {
        keep(&searches, &path);
    }
    let violations: Vec<_> =
        searches.iter().flat_map(Search::worst).filter(|found| found.is_violation()).collect();
    assert!(
        rows.iter().all(|row| row.cycles.iter().all(|cycles| *cycles > 0)),
        "a machine was never under control"
    );
    certificate
        .finish(format_args!("{cycles} cycles of each machine and policy, {} violations", violations.len()));
    assert!(violations.is_empty(), "{} beyond a limit:\n{}", violations.len(), explain(&violations));
}

/// `HEXAD_ADVERSARY_TRACE="LINE OF A GENOME"` prints its run, and what each cycle added to an extreme.
#[test]
#[ignore = "prints a run for a person"]
fn trace() {
    let line = env::var("HEXAD_ADVERSARY_TRACE").expect("HEXAD_ADVERSARY_TRACE: a line of worst.txt");
    let genome = Genome::parse(&line).expect("a genome");
    println!("{:#?}", Scenario::of(&genome));
    let mut before = Extremes::default();
    let outcome = run_with(&genome, None, |observed, input, output| {
        trace::print(observed, input, output, &mut before);
    });
    println!("{:?}", outcome.extremes.violations());
}

#[test]
fn a_genome_is_written_and_read_back() {
    let mut random = Random::new(7);
    for machine in 0..MACHINES.len() {
        for policy in [ViolationPolicy::Stop, ViolationPolicy::Limit] {
            let genome = Genome::random(machine, policy, Sensors::ALL[machine % 4], &mut random);
            let line = format!("{genome} # velocity 1.0");
            assert!(Genome::parse(&line).is_some_and(|read| read == genome), "{line}");
        }
    }
    assert!(Genome::parse("nobody stop exact 00").is_none());
}

#[test]
fn a_genome_is_one_run() {
    let mut random = Random::new(11);
    for machine in 0..MACHINES.len() {
        let genome = Genome::random(machine, ViolationPolicy::Stop, Sensors::ALL[machine % 4], &mut random);
        let (first, second) = (run(&genome, None), run(&genome, None));
        assert_eq!((first.extremes, first.cycles), (second.extremes, second.cycles));
    }
}
