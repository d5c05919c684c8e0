//! Genomes: numbers that describe a run, and how they change from one generation to the next.

use core::fmt;

use hexad::control::parameters::ViolationPolicy;
use hexad::model::random::Random;

use super::common::observed::Rates;
use super::machines::MACHINES;

/// More than any run reads; the rest has no effect.
pub const GENES: usize = 96;
/// Largest number of genes that change at once.
const MOST_CHANGES: f64 = 5.0;
/// Standard deviations of a change, of the whole range of a gene: far, near, next to it.
const DEVIATIONS: [f64; 3] = [0.3, 0.03, 0.003];
/// Part of the changes that draw a gene anew.
const REDRAWN: f64 = 0.25;

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
    const NAMES: [(Self, &str); 4] = [
        (Self::Exact, "exact"),
        (Self::Lengths, "lengths"),
        (Self::Mixed, "mixed"),
        (Self::Frozen, "frozen"),
    ];

    pub fn rates(self) -> Rates {
        match self {
            Self::Exact | Self::Frozen => Rates::Always,
            Self::Lengths => Rates::Never,
            Self::Mixed => Rates::Sometimes,
        }
    }
}

/// What a run is made of.
#[derive(Clone, PartialEq)]
pub struct Genome {
    /// Index in [`MACHINES`].
    pub machine: usize,
    pub policy: ViolationPolicy,
    pub sensors: Sensors,
    pub genes: [u16; GENES],
}

impl Genome {
    pub fn random(machine: usize, policy: ViolationPolicy, sensors: Sensors, random: &mut Random) -> Self {
        Self { machine, policy, sensors, genes: core::array::from_fn(|_| draw(random)) }
    }

    pub fn is_frozen(&self) -> bool {
        self.sensors == Sensors::Frozen
    }

    /// A few genes are other ones.
    pub fn mutated(&self, random: &mut Random) -> Self {
        let mut next = self.clone();
        for _ in 0..1 + (random.uniform() * MOST_CHANGES) as usize {
            let gene = &mut next.genes[(random.uniform() * GENES as f64) as usize];
            let deviation = DEVIATIONS[(random.uniform() * DEVIATIONS.len() as f64) as usize];
            *gene = if random.uniform() < REDRAWN {
                draw(random)
            } else {
                (f64::from(*gene) + 65_536.0 * deviation * random.gaussian()).clamp(0.0, 65_535.0) as u16
            };
        }
        next
    }

    /// The genes before a random place are those of the other.
    pub fn crossed(&self, other: &Self, random: &mut Random) -> Self {
        let mut next = self.clone();
        let place = (random.uniform() * GENES as f64) as usize;
        next.genes[..place].copy_from_slice(&other.genes[..place]);
        next
    }

    /// Reads what `Display` writes; words after the genes are a comment.
    pub fn parse(line: &str) -> Option<Self> {
        let mut words = line.split_whitespace();
        let name = words.next()?;
        let machine = MACHINES.iter().position(|machine| *machine == name)?;
        let policy = match words.next()? {
            "stop" => ViolationPolicy::Stop,
            "limit" => ViolationPolicy::Limit,
            _ => return None,
        };
        let word = words.next()?;
        let (sensors, _) = *Sensors::NAMES.iter().find(|(_, name)| *name == word)?;
        let text = words.next().filter(|text| text.len() == 4 * GENES && text.is_ascii())?;
        let mut genes = [0; GENES];
        for (gene, digits) in genes.iter_mut().zip(text.as_bytes().chunks(4)) {
            *gene = u16::from_str_radix(core::str::from_utf8(digits).ok()?, 16).ok()?;
        }
        Some(Self { machine, policy, sensors, genes })
    }
}

impl fmt::Display for Genome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let policy = match self.policy {
            ViolationPolicy::Stop => "stop",
            ViolationPolicy::Limit => "limit",
        };
        let sensors =
            Sensors::NAMES.iter().find(|(sensors, _)| *sensors == self.sensors).map_or("", |(_, name)| name);
        write!(f, "{} {policy} {sensors} ", MACHINES[self.machine])?;
        self.genes.iter().try_for_each(|gene| write!(f, "{gene:04x}"))
    }
}

fn draw(random: &mut Random) -> u16 {
    (random.uniform() * 65_536.0) as u16
}

/// Reads the genes one after the other.
pub struct Reader<'a>(core::slice::Iter<'a, u16>);

impl<'a> Reader<'a> {
    pub fn new(genome: &'a Genome) -> Self {
        Self(genome.genes.iter())
    }

    /// In \[0, 1).
    pub fn share(&mut self) -> f64 {
        f64::from(*self.0.next().unwrap_or_else(|| panic!("more than {GENES} genes"))) / 65_536.0
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    /// Each power of ten is as likely as the other.
    pub fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.share())
    }

    pub fn choice<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.share() * of.len() as f64) as usize]
    }

    /// Zero in so many of the cases, else within a range.
    pub fn sometimes(&mut self, never: f64, low: f64, high: f64) -> f64 {
        let share = self.share();
        if share < never { 0.0 } else { low + (high - low) * (share - never) / (1.0 - never) }
    }
}
