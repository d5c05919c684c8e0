//! Search for the longest cycle: runs that are drawn at random, then changes of those with the longest ones.

use std::hint::black_box;
use std::ops::Range;
use std::time::{Duration, Instant};

use hexad::control::controller::Controller;
use hexad::control::parameters::ViolationPolicy;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::state::State;
use hexad::model::random::Random;

use super::count::instructions;
use hexad_support::search::genome::{Genome, Sensors, World};
use hexad_support::search::run::run_with;
use hexad_support::search::scenario::Scenario;

/// Runs that had the longest cycles of their time.
const KNOWN: &str = include_str!("longest.txt");
/// Runs that are kept, and of each machine.
const KEPT: usize = 24;
const KEPT_OF_MACHINE: usize = 6;
/// Part of the genomes that are drawn anew, and of the others that are crossed.
const DRAWN: f64 = 0.2;
const CROSSED: f64 = 0.2;
/// A cycle that seems to be the longest of its run is repeated so often, as the host may have taken a part of its time.
const REPETITIONS: usize = 8;
/// It is counted if it took at least this part of the time of one that is kept: counting takes ten thousand times as long.
const WORTH_COUNTING: f64 = 0.85;
/// Longest period: slower loops do several steps of the reference in a cycle \[ns\].
const LONGEST_PERIOD_NS: u64 = 1_000_000;

/// The longest cycle of a run.
#[derive(Clone)]
pub struct Found {
    pub genome: Genome,
    pub cycle: usize,
    pub ns: f64,
    pub instructions: u64,
    /// Before and after the cycle.
    pub states: [State; 2],
}

/// What a search has found.
pub struct Search {
    /// The longest first.
    pub found: Vec<Found>,
    /// That were timed.
    pub cycles: usize,
}

impl Search {
    pub const fn new() -> Self {
        Self { found: vec![], cycles: 0 }
    }

    pub fn climb(policy: ViolationPolicy, machines: Range<usize>, seed: u64, time: Duration) -> Self {
        hexad::realtime::setup::denormals::flush();
        let begun = Instant::now();
        let mut search = Self::new();
        let mut random = Random::new(seed << 1 ^ policy as u64);
        let known = KNOWN.lines().filter_map(Genome::parse);
        known
            .filter(|genome| genome.policy == policy && machines.contains(&genome.machine))
            .for_each(|genome| search.run(&genome));
        loop {
            let genome = search.next(policy, &machines, &mut random);
            if Scenario::of(&genome).parameters.period_ns <= LONGEST_PERIOD_NS {
                search.run(&genome);
            }
            if begun.elapsed() >= time {
                return search;
            }
        }
    }

    fn next(&self, policy: ViolationPolicy, machines: &Range<usize>, random: &mut Random) -> Genome {
        let index = |random: &mut Random, count: usize| (random.uniform() * count as f64) as usize;
        let pick = |random: &mut Random| &self.found[index(random, self.found.len())].genome;
        if self.found.len() < KEPT.min(KEPT_OF_MACHINE * machines.len()) || random.uniform() < DRAWN {
            return Genome::random(
                machines.start + index(random, machines.len()),
                policy,
                Sensors::Exact,
                World::Model,
                random,
            );
        }
        let parent = pick(random).clone();
        if random.uniform() < CROSSED {
            return parent.crossed(pick(random), random).mutated(random);
        }
        parent.mutated(random)
    }

    /// Counts the longest cycle of a run, unless it is far from those that are kept.
    pub fn run(&mut self, genome: &Genome) {
        let mut longest = Timed::default();
        self.cycles += time_cycles(genome, &mut longest);
        let kept = || self.found.iter().filter(|found| found.genome.machine == genome.machine);
        let is_full = self.found.len() >= KEPT || kept().count() >= KEPT_OF_MACHINE;
        let shortest = if is_full {
            kept().chain(self.found.last()).map(|found| found.ns).fold(f64::INFINITY, f64::min)
        } else {
            0.0
        };
        if let Some((before, input)) = longest.call.filter(|_| longest.ns > WORTH_COUNTING * shortest) {
            self.add(Found {
                genome: genome.clone(),
                cycle: longest.cycle,
                ns: longest.ns,
                instructions: instructions(&before, &input),
                states: longest.states,
            });
        }
    }

    fn add(&mut self, found: Found) {
        let machine = found.genome.machine;
        let place = self.found.partition_point(|other| other.instructions >= found.instructions);
        self.found.insert(place, found);
        let of_machine = |other: &Found| other.genome.machine == machine;
        if self.found.iter().filter(|other| of_machine(other)).count() > KEPT_OF_MACHINE {
            let last = self.found.iter().rposition(of_machine);
            last.map(|last| self.found.remove(last));
        }
        self.found.truncate(KEPT);
    }
}

/// The cycle of a run that took the longest.
#[derive(Default)]
struct Timed {
    ns: f64,
    cycle: usize,
    states: [State; 2],
    /// The controller before it, and its input.
    call: Option<(Controller, Input)>,
}

/// Times the cycles of a run. Returns their number.
fn time_cycles(genome: &Genome, longest: &mut Timed) -> usize {
    let mut before: Option<(Controller, State)> = None;
    let mut cycle = 0;
    run_with(genome, None, |observed, input, output| {
        if let Some((before, state)) = &before {
            let mut ns = time_ns(before, input);
            if ns > longest.ns {
                ns = (0..REPETITIONS).map(|_| time_ns(before, input)).fold(ns, f64::min);
            }
            if ns > longest.ns {
                let call = Some((before.clone(), *input));
                *longest = Timed { ns, cycle, states: [*state, output.state], call };
            }
        }
        before = Some((observed.controller.clone(), output.state));
        cycle += 1;
    });
    cycle
}

fn time_ns(before: &Controller, input: &Input) -> f64 {
    let mut controller = before.clone();
    let started = Instant::now();
    black_box(controller.step(black_box(input)));
    started.elapsed().as_nanos() as f64
}
