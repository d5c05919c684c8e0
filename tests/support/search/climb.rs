//! The search: random genomes first, then changes of the worst of each property.

use std::env;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{available_parallelism, scope};
use std::time::{Duration, Instant};

use hexad::control::parameters::ViolationPolicy;
use hexad::model::random::Random;

use super::genome::{Genome, Sensors, World};
use super::machines::MACHINES;
use super::property::PROPERTIES;
use super::run::{Doctor, Outcome, run};
use super::table::Row;

/// Genomes that are kept of each property and policy.
const KEPT: usize = 4;
/// Part of the genomes that are drawn anew, and of the others that are crossed.
const DRAWN: f64 = 0.25;
const CROSSED: f64 = 0.2;
/// Parts of the runs by what the sensors send; the rest sends lengths and rates.
const SENSORS: [(Sensors, f64); 3] =
    [(Sensors::Frozen, 0.05), (Sensors::Lengths, 0.35), (Sensors::Mixed, 0.15)];
/// Part of the runs on a platform that is not as its file says.
const UNMODELLED: f64 = 0.3;
/// Runs of each machine that are all drawn anew.
const FIRST_RUNS: u64 = 60;

/// A genome with what it reached.
#[derive(Clone)]
pub struct Found {
    pub genome: Genome,
    /// Index in [`PROPERTIES`].
    pub property: usize,
    pub value: f64,
    pub outcome: Outcome,
}

impl Found {
    pub fn is_violation(&self) -> bool {
        fails(&self.genome, self.property, &self.outcome)
    }
}

/// What the search of one machine has found.
pub struct Search {
    pub row: Row,
    /// The worst first, for each policy and quantity.
    pools: [[Vec<Found>; PROPERTIES.len()]; 2],
    doctor: Option<Doctor>,
    /// The only property to climb for.
    aim: Option<usize>,
}

/// Whether a property does not hold in a run of which it is claimed.
pub fn fails(genome: &Genome, property: usize, outcome: &Outcome) -> bool {
    let claimed = &PROPERTIES[property];
    claimed.is_claimed(genome) && outcome.worst[property] > claimed.allowed()
}

/// Sensors by a share of all runs.
fn drawn(parts: [(Sensors, f64); 3], mut share: f64) -> Sensors {
    for (sensors, part) in parts {
        if share < part {
            return sensors;
        }
        share -= part;
    }
    Sensors::Exact
}

impl Found {
    /// The same violation with as little as possible that is out of the ordinary.
    pub fn simple(&self, doctor: Option<Doctor>) -> Genome {
        self.genome.simple(|genome| fails(genome, self.property, &run(genome, doctor)))
    }
}

impl Search {
    pub fn new(machine: usize) -> Self {
        Self {
            row: Row::new(machine),
            pools: core::array::from_fn(|_| core::array::from_fn(|_| Vec::new())),
            doctor: None,
            aim: None,
        }
    }

    /// A search for one violation, against a controller that is wrong on purpose.
    pub fn doctored(machine: usize, doctor: Doctor, aim: usize) -> Self {
        Self { doctor: Some(doctor), aim: Some(aim), ..Self::new(machine) }
    }

    /// Whether what it aims at is found.
    fn is_found(&self) -> bool {
        self.aim.is_some_and(|aim| self.row.violations[aim] > 0)
    }

    /// Runs a genome and keeps it where it is among the worst.
    pub fn add(&mut self, genome: &Genome) {
        let outcome = run(genome, self.doctor);
        let row = &mut self.row;
        row.runs += 1;
        row.cycles[genome.policy as usize] += outcome.cycles;
        let judged = &mut row.judged[genome.world as usize][genome.sensors as usize];
        let is_as_named = genome.sensors.have_sent(outcome.measured);
        for (index, property) in PROPERTIES.iter().enumerate() {
            let value = outcome.worst[index];
            if !property.is_claimed(genome) || value == f64::NEG_INFINITY {
                continue;
            }
            judged[index] += u64::from(is_as_named);
            row.worst[index] = row.worst[index].max(value);
            row.violations[index] += u64::from(fails(genome, index, &outcome));
            let pool = &mut self.pools[genome.policy as usize][index];
            let place = pool.partition_point(|found| found.value >= value);
            if place < KEPT {
                pool.insert(
                    place,
                    Found { genome: genome.clone(), property: index, value, outcome: outcome.clone() },
                );
                pool.truncate(KEPT);
            }
        }
        if !genome.is_frozen() {
            self.row.end_stops += u64::from(outcome.end_stops);
        }
    }

    /// The next genome; the same for the same numbers of runs and of the seed.
    fn next(&self, seed: u64) -> Genome {
        let machine = self.row.machine;
        let mut random = Random::new(seed ^ self.row.runs << 8 ^ (machine as u64) << 56);
        let [stop, limit] = self.row.cycles;
        let policy = if stop <= limit { ViolationPolicy::Stop } else { ViolationPolicy::Limit };
        let sensors = drawn(SENSORS, random.uniform());
        let world = if random.uniform() < UNMODELLED { World::Unmodelled } else { World::Model };
        let pools = &self.pools[policy as usize];
        let property = (random.uniform() * PROPERTIES.len() as f64) as usize;
        let property = self.aim.unwrap_or(property);
        let is_drawn = self.row.runs < FIRST_RUNS || random.uniform() < DRAWN;
        let pick = |random: &mut Random, pool: &[Found]| {
            pool.get((random.uniform() * pool.len() as f64) as usize).map(|found| found.genome.clone())
        };
        let Some(parent) = pick(&mut random, &pools[property]).filter(|_| !is_drawn) else {
            return Genome::random(machine, policy, sensors, world, &mut random);
        };
        let other = (random.uniform() * PROPERTIES.len() as f64) as usize;
        match pick(&mut random, &pools[other]).filter(|_| random.uniform() < CROSSED) {
            Some(other) => parent.crossed(&other, &mut random).mutated(&mut random),
            None => parent.mutated(&mut random),
        }
    }

    /// Searches until so many cycles were under control with each policy, and at least for so long; `advance` counts them.
    pub fn climb(&mut self, seed: u64, cycles: u64, least: Duration, advance: impl Fn(u64)) {
        let began = Instant::now();
        // A stop in each world with each of the sensors, by every other machine: however short the search is, what is claimed is judged there.
        let mut random = Random::new(seed ^ (self.row.machine as u64) << 56);
        let all = World::ALL.into_iter().flat_map(|world| Sensors::ALL.map(|sensors| (world, sensors)));
        for (world, sensors) in all.skip(self.row.machine % 2).step_by(2) {
            let policy = ViolationPolicy::Stop;
            self.add(&Genome::random(self.row.machine, policy, sensors, world, &mut random).stopped());
        }
        let counted = |row: &Row| row.cycles.iter().map(|done| *done.min(&cycles)).sum::<u64>();
        advance(counted(&self.row));
        while (counted(&self.row) < 2 * cycles || began.elapsed() < least) && !self.is_found() {
            let (genome, before) = (self.next(seed), counted(&self.row));
            self.add(&genome);
            advance(counted(&self.row) - before);
        }
    }

    /// The worst genome of each policy and property.
    pub fn worst(&self) -> impl Iterator<Item = &Found> {
        self.pools.iter().flatten().filter_map(|pool| pool.first())
    }
}

/// Searches with every machine, on every processor; each search begins with the genomes that are known. `HEXAD_SEARCH_SECONDS` makes it
/// last at least as long.
pub fn search(known: &[Genome], seed: u64, cycles: u64, advance: impl Fn(u64) + Sync) -> Vec<Search> {
    let workers = available_parallelism().map_or(1, usize::from).min(MACHINES.len());
    let seconds =
        env::var("HEXAD_SEARCH_SECONDS").map_or(0.0, |text| text.parse().expect("a number of seconds"));
    let least = Duration::from_secs_f64(seconds * workers as f64 / MACHINES.len() as f64);
    let (next, searches) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let advance = &advance;
    let work = || {
        loop {
            let machine = next.fetch_add(1, Ordering::Relaxed);
            if machine >= MACHINES.len() {
                return;
            }
            let mut search = Search::new(machine);
            known.iter().filter(|genome| genome.machine == machine).for_each(|genome| search.add(genome));
            search.climb(seed, cycles, least, advance);
            searches.lock().unwrap().push(search);
        }
    };
    scope(|scope| {
        (0..workers).for_each(|_| drop(scope.spawn(work)));
    });
    let mut searches = searches.into_inner().unwrap();
    searches.sort_by_key(|search| search.row.machine);
    searches
}
