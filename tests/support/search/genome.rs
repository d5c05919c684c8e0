//! Genomes: named numbers that describe a run, how they change from one generation to the next, and how one becomes simple.

use core::fmt;
use std::collections::BTreeMap;

use hexad::control::parameters::ViolationPolicy;
use hexad::control::signals::state::Request;
use hexad::model::random::Random;

use super::machines::MACHINES;
use super::scenario::Scenario;
use crate::rig::Rates;

/// Largest number of genes that change at once.
const MOST_CHANGES: f64 = 5.0;
/// Standard deviations of a change, of the whole range of a gene: far, near, next to it.
const DEVIATIONS: [f64; 3] = [0.3, 0.03, 0.003];
/// Part of the changes that draw a gene anew.
const REDRAWN: f64 = 0.25;
/// Digits of a gene, the fewest first, with which a simple genome is tried.
const DIGITS: [i32; 3] = [1, 2, 3];

/// What the sensors send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensors {
    /// Lengths and rates.
    Exact,
    /// Lengths alone.
    Lengths,
    /// Rates in some measurements.
    Mixed,
    /// Lengths and rates that freeze: judged by fewer bounds, as the controller cannot know.
    Frozen,
}

impl Sensors {
    pub const ALL: [Self; 4] = [Self::Exact, Self::Lengths, Self::Mixed, Self::Frozen];

    /// Whether so many measurements without and with rates are what they send.
    pub fn have_sent(self, [without, with]: [u64; 2]) -> bool {
        let expected = match self {
            Self::Exact | Self::Frozen => [false, true],
            Self::Lengths => [true, false],
            Self::Mixed => [true, true],
        };
        [without > 0, with > 0] == expected
    }

    pub fn rates(self) -> Rates {
        match self {
            Self::Exact | Self::Frozen => Rates::Always,
            Self::Lengths => Rates::Never,
            Self::Mixed => Rates::Sometimes,
        }
    }
}

/// What the platform is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum World {
    /// As the machine file says.
    Model,
    /// With friction, delay, payload and sensor noise that the machine file does not state.
    Unmodelled,
}

impl World {
    pub const ALL: [Self; 2] = [Self::Model, Self::Unmodelled];
}

/// A variant as it is written.
pub fn name(variant: impl fmt::Debug) -> String {
    format!("{variant:?}").to_lowercase()
}

/// The variant with a name.
fn named<T: Copy + fmt::Debug>(variants: &[T], written: &str) -> Option<T> {
    variants.iter().copied().find(|variant| name(variant) == written)
}

/// What a run is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Genome {
    /// Index in [`MACHINES`].
    pub machine: usize,
    pub policy: ViolationPolicy,
    pub sensors: Sensors,
    pub world: World,
    /// In \[0, 1\]; one that is not there is 0, the ordinary case.
    pub genes: BTreeMap<String, f64>,
}

impl Genome {
    pub fn random(
        machine: usize,
        policy: ViolationPolicy,
        sensors: Sensors,
        world: World,
        random: &mut Random,
    ) -> Self {
        let empty = Self { machine, policy, sensors, world, genes: BTreeMap::new() };
        let mut reader = Reader { random: Some(random), ..Reader::new(&empty) };
        Scenario::read(&empty, &mut reader);
        Self { genes: reader.genes, ..empty }
    }

    /// The same with a request to stop in the middle of the run.
    pub fn stopped(mut self) -> Self {
        let place = Request::ALL.iter().position(|request| *request == Request::Stop).unwrap();
        let word = (place as f64 + 0.5) / Request::ALL.len() as f64;
        self.genes.extend([("request_1.at".into(), 0.93), ("request_1.word".into(), word)]);
        self
    }

    pub fn is_frozen(&self) -> bool {
        self.sensors == Sensors::Frozen
    }

    /// A few genes are other ones.
    pub fn mutated(&self, random: &mut Random) -> Self {
        let mut next = self.clone();
        let count = next.genes.len() as f64;
        for _ in 0..1 + (random.uniform() * MOST_CHANGES) as usize {
            let Some(gene) = next.genes.values_mut().nth((random.uniform() * count) as usize) else { break };
            let deviation = DEVIATIONS[(random.uniform() * DEVIATIONS.len() as f64) as usize];
            *gene = if random.uniform() < REDRAWN {
                random.uniform()
            } else {
                (*gene + deviation * random.near_gaussian()).clamp(0.0, 1.0)
            };
        }
        next
    }

    /// A part of the genes, neighbours by name, are those of the other.
    pub fn crossed(&self, other: &Self, random: &mut Random) -> Self {
        let mut next = self.clone();
        let place = (random.uniform() * other.genes.len() as f64) as usize;
        next.genes.extend(other.genes.iter().take(place).map(|(name, value)| (name.clone(), *value)));
        next
    }

    /// The same failure with as little as possible that is out of the ordinary, for a person to read. `fails` runs a genome.
    pub fn simple(&self, fails: impl Fn(&Self) -> bool) -> Self {
        let mut best = self.clone();
        let try_to = |best: &mut Self, change: &dyn Fn(&mut Self)| {
            let mut next = best.clone();
            change(&mut next);
            let is_simpler = next != *best && fails(&next);
            if is_simpler {
                *best = next;
            }
            is_simpler
        };
        try_to(&mut best, &|next| next.world = World::Model);
        try_to(&mut best, &|next| next.sensors = Sensors::Exact);
        // What one gene means may hang on another: until nothing changes.
        let mut is_changed = true;
        while core::mem::take(&mut is_changed) {
            for name in best.genes.keys().cloned().collect::<Vec<_>>() {
                is_changed |= try_to(&mut best, &|next| {
                    next.genes.remove(&name);
                });
            }
        }
        for name in best.genes.keys().cloned().collect::<Vec<_>>() {
            let _ = DIGITS.iter().any(|digits| {
                let scale = 10_f64.powi(*digits);
                let round = |next: &mut Self| {
                    next.genes.entry(name.clone()).and_modify(|gene| *gene = (*gene * scale).round() / scale);
                };
                try_to(&mut best, &round)
            });
        }
        best
    }

    /// Reads what `Display` writes, in one line or in several; after `#` a line is a comment.
    pub fn parse(text: &str) -> Option<Self> {
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or(""));
        let mut words = lines.flat_map(str::split_whitespace);
        let machine = words.next().and_then(|name| MACHINES.iter().position(|machine| *machine == name))?;
        let policy = named(&[ViolationPolicy::Stop, ViolationPolicy::Limit], words.next()?)?;
        let sensors = named(&Sensors::ALL, words.next()?)?;
        let world = named(&World::ALL, words.next()?)?;
        let gene = |word: &str| {
            let (name, value) = word.split_once('=')?;
            Some((name.to_owned(), value.parse().ok()?))
        };
        let genes = words.map(gene).collect::<Option<_>>()?;
        Some(Self { machine, policy, sensors, world, genes })
    }
}

impl fmt::Display for Genome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, policy, sensors, world, genes } = self;
        write!(f, "{} {} {} {}", MACHINES[*machine], name(policy), name(sensors), name(world))?;
        genes
            .iter()
            .filter(|(_, value)| **value != 0.0)
            .try_for_each(|(name, value)| write!(f, " {name}={value}"))
    }
}

/// Reads genes by name.
pub struct Reader<'a> {
    genes: BTreeMap<String, f64>,
    /// Draws those that are not there.
    random: Option<&'a mut Random>,
    part: String,
}

impl Reader<'_> {
    pub fn new(genome: &Genome) -> Self {
        Self { genes: genome.genes.clone(), random: None, part: String::new() }
    }

    /// Reads with names that begin with that of a part.
    pub fn part<T>(&mut self, name: &str, read: impl FnOnce(&mut Self) -> T) -> T {
        let whole = self.part.clone();
        self.part += &format!("{name}.");
        let value = read(self);
        self.part = whole;
        value
    }

    /// In \[0, 1\].
    pub fn share(&mut self, name: &str) -> f64 {
        let name = self.part.clone() + name;
        match &mut self.random {
            Some(random) => *self.genes.entry(name).or_insert_with(|| random.uniform()),
            None => self.genes.get(&name).copied().unwrap_or(0.0),
        }
    }

    pub fn within(&mut self, name: &str, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share(name)
    }

    /// Each power of ten is as likely as the other.
    pub fn logarithmic(&mut self, name: &str, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.share(name))
    }

    pub fn index(&mut self, name: &str, count: usize) -> usize {
        ((self.share(name) * count as f64) as usize).min(count - 1)
    }

    pub fn choice<T: Copy>(&mut self, name: &str, of: &[T]) -> T {
        of[self.index(name, of.len())]
    }

    /// Zero in so many of the cases, else within a range.
    pub fn sometimes(&mut self, name: &str, never: f64, low: f64, high: f64) -> f64 {
        let share = self.share(name);
        if share < never { 0.0 } else { low + (high - low) * (share - never) / (1.0 - never) }
    }
}
