//! The tests: genomes that are known, the search, and that a genome is a run.

use std::collections::HashMap;
use std::{env, fs};

use hexad::control::parameters::ViolationPolicy;
use hexad::model::random::Random;
use hexad_support::certificate::Certificate;
use hexad_support::extremes::Extremes;
use hexad_support::search::climb::{Found, Search, fails, search};
use hexad_support::search::genome::{Genome, Sensors, World};
use hexad_support::search::machines::MACHINES;
use hexad_support::search::property::{self, PROPERTIES, Property, place};
use hexad_support::search::run::{run, run_with};
use hexad_support::search::scenario::Scenario;
use hexad_support::search::table::{self, Row};
use hexad_support::{kept_files, repository};

use super::trace;

/// Cycles under control of each machine with each policy, beside those of the genomes that are known.
const CYCLES: u64 = 10_000;
const LONG_CYCLES: u64 = 1_000_000;
/// Genomes that are written of each policy and property.
const KEPT: u32 = 3;
/// Violations that are made simple, which takes seconds.
const EXPLAINED: usize = 3;

/// The genomes of `worst.txt`, which were the worst of their time.
fn known() -> Vec<Genome> {
    let path = repository().join("tests/adversary/worst.txt");
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| Genome::parse(line).unwrap_or_else(|| panic!("not a genome: {line}"))).collect()
}

/// Writes the worst genomes of each policy and property, over all machines.
fn keep(searches: &[Search], path: &str) {
    let mut all: Vec<_> = searches.iter().flat_map(Search::worst).collect();
    all.sort_by(|a, b| b.value.total_cmp(&a.value));
    let mut counts = HashMap::new();
    let mut lines: Vec<String> = Vec::new();
    for found in all {
        let count = counts.entry((found.genome.policy as u32, found.property)).or_insert(0);
        *count += 1;
        let genome = found.genome.to_string();
        if *count <= KEPT && !lines.iter().any(|line| line.starts_with(&genome)) {
            lines.push(format!("{genome} # {} {:.6}\n", PROPERTIES[found.property].name, found.value));
        }
    }
    let head = "# machine, policy, sensors, world, genes; property and value when it was found\n";
    fs::write(path, head.to_owned() + &lines.concat()).unwrap();
}

/// Violations in words; the first are made simple and written to files.
fn explain(violations: &[&Found]) -> String {
    let mut text = String::new();
    for (number, found) in violations.iter().enumerate() {
        let (property, fault) = (&PROPERTIES[found.property], found.outcome.fault);
        text += &format!("{}: {:.4} of {}, fault {fault:?}", property.name, found.value, property.allowed());
        if number < EXPLAINED {
            let file = kept_files().join(format!("violation-{number}.txt"));
            let simple = found.simple(None);
            let said = format!(
                "# {}: {}\n{}\n",
                property.name,
                property.claim,
                simple.to_string().replace(' ', "\n")
            );
            fs::write(&file, said).unwrap();
            text += &format!("; HEXAD_ADVERSARY_TRACE={}: {simple}", file.display());
        }
        text += "\n";
    }
    text
}

/// Least parts of all runs in which the sensors are these: what docs/safety.md says, less the runs that are known and those of the start.
const LEAST: [(Sensors, f64); 4] =
    [(Sensors::Exact, 0.2), (Sensors::Lengths, 0.1), (Sensors::Mixed, 0.04), (Sensors::Frozen, 0.02)];

/// Worlds that were left out: sensors of too few runs, and properties that were judged in no run of a world where they are claimed.
fn left_out(rows: &[Row]) -> Vec<String> {
    let judged = |world: World, sensors: Sensors, property: usize| {
        rows.iter().map(|row| row.judged[world as usize][sensors as usize][property]).sum::<u64>()
    };
    let (runs, always) = (rows.iter().map(|row| row.runs).sum::<u64>(), place("reference velocity"));
    let mut left_out = Vec::new();
    for (sensors, least) in LEAST {
        let count = World::ALL.map(|world| judged(world, sensors, always)).iter().sum::<u64>();
        if (count as f64) < least * runs as f64 {
            left_out.push(format!("{sensors:?}: {count} of {runs} runs"));
        }
        for world in World::ALL {
            let claimed = PROPERTIES.iter().enumerate().filter(|(_, property)| {
                property.worlds.contains(&world)
                    && (property.with_frozen_sensors || sensors != Sensors::Frozen)
            });
            let unjudged = claimed.filter(|(index, _)| judged(world, sensors, *index) == 0);
            left_out.extend(unjudged.map(|(_, it)| format!("{}: {world:?}, {sensors:?}", it.name)));
        }
    }
    left_out
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
    assert_eq!(left_out(&rows), [""; 0]);
    certificate
        .finish(format_args!("{cycles} cycles of each machine and policy, {} violations", violations.len()));
    assert!(violations.is_empty(), "{} beyond a limit:\n{}", violations.len(), explain(&violations));
}

/// `HEXAD_ADVERSARY_TRACE=FILE` prints the run of the genome in a file, and what each cycle added to an extreme.
#[test]
#[ignore = "prints a run for a person"]
fn trace() {
    let file = env::var("HEXAD_ADVERSARY_TRACE").expect("HEXAD_ADVERSARY_TRACE: a file");
    let genome = Genome::parse(&fs::read_to_string(file).expect("a file")).expect("a genome");
    println!("{:#?}", Scenario::of(&genome));
    let mut before = Extremes::default();
    let outcome = run_with(&genome, None, |observed, input, output| {
        trace::print(observed, input, output, &mut before);
    });
    let failed = |(index, property): (usize, &Property)| {
        fails(&genome, index, &outcome).then_some((property.name, outcome.worst[index]))
    };
    println!("{:?}", PROPERTIES.iter().enumerate().filter_map(failed).collect::<Vec<_>>());
}

#[test]
fn a_genome_is_written_and_read_back() {
    let mut random = Random::new(7);
    for machine in 0..MACHINES.len() {
        for policy in [ViolationPolicy::Stop, ViolationPolicy::Limit] {
            let world = World::ALL[machine % 2];
            let genome = Genome::random(machine, policy, Sensors::ALL[machine % 4], world, &mut random);
            for text in [format!("{genome} # velocity 1.0"), genome.to_string().replace(' ', "\n")] {
                assert!(Genome::parse(&text).is_some_and(|read| read == genome), "{text}");
            }
        }
    }
    assert!(["nobody stop exact model", "tilted stop exact model a=b"].map(Genome::parse) == [None, None]);
}

#[test]
fn a_genome_is_one_run() {
    let mut random = Random::new(11);
    for machine in 0..MACHINES.len() {
        let genome = Genome::random(
            machine,
            ViolationPolicy::Stop,
            Sensors::ALL[machine % 4],
            World::ALL[machine % 2],
            &mut random,
        );
        let (first, second) = (run(&genome, None), run(&genome, None));
        assert_eq!((first.worst, first.cycles), (second.worst, second.cycles));
    }
}

/// What has been searched, where a user looks for it.
#[test]
fn the_properties_are_in_the_guide_to_safety() {
    let table = property::table();
    println!("{table}");
    let guide = fs::read_to_string(repository().join("docs/safety.md")).unwrap();
    assert!(guide.contains(&table), "docs/safety.md must have:\n{table}");
}
