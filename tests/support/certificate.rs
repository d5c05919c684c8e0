//! A certificate: the long form of a test, with its progress and a line for the table in `docs/benchmarks.md`.
//!
//! `HEXAD_LONG=1 cargo test certificate -- --include-ignored --nocapture --test-threads=1` runs all of them, and `HEXAD_LONG=5` makes them five times as
//! long. Without the variable each is a short run with a fixed seed. `HEXAD_SEED` repeats a run.

use std::env;
use std::fmt::Display;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Instant, SystemTime};

use indicatif::{ProgressBar, ProgressStyle};

/// Seed of every short run.
const SHORT_SEED: u64 = 1;

/// All cases of a table in a long run; every so manieth in a short one, from the first on.
pub fn cases<T>(all: impl IntoIterator<Item = T>, every: usize) -> Vec<T> {
    all.into_iter().step_by(if Certificate::is_long() { 1 } else { every }).collect()
}

/// A run of a test, short or long.
pub struct Certificate {
    name: &'static str,
    total: u64,
    done: AtomicU64,
    seed: OnceLock<u64>,
    /// Hidden where standard error is no terminal.
    bar: ProgressBar,
    began: Instant,
}

impl Certificate {
    /// Begins a run of so many trials, cycles or seconds.
    pub fn new(name: &'static str, short: u64, long: u64) -> Self {
        let (total, bar) = match Self::factor() {
            0 => (short, ProgressBar::hidden()),
            factor => (factor * long, ProgressBar::new(factor * long)),
        };
        let style = ProgressStyle::with_template("{msg} {wide_bar} {human_pos} of {human_len}, {eta} left");
        bar.set_style(style.unwrap());
        bar.set_message(name);
        Self { name, total, done: AtomicU64::new(0), seed: OnceLock::new(), bar, began: Instant::now() }
    }

    /// How many times as long as the table's the long form is, by `HEXAD_LONG`; 0 is the short form.
    fn factor() -> u64 {
        env::var("HEXAD_LONG").map_or(0, |text| text.parse().expect("HEXAD_LONG must be a number"))
    }

    /// Whether `HEXAD_LONG` selects the long forms.
    pub fn is_long() -> bool {
        Self::factor() > 0
    }

    /// Length of this run.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// `HEXAD_SEED`; else a fixed one for the short form, and the time for the long one.
    pub fn seed(&self) -> u64 {
        *self.seed.get_or_init(|| {
            let seed = env::var("HEXAD_SEED").map(|text| text.parse().expect("HEXAD_SEED must be a number"));
            let seed = seed.unwrap_or_else(|_| match Self::is_long() {
                true => SystemTime::UNIX_EPOCH.elapsed().unwrap().as_secs(),
                false => SHORT_SEED,
            });
            println!("certificate {}: HEXAD_SEED={seed}", self.name);
            seed
        })
    }

    /// Counts what was done: on a bar, or in a line at every tenth of the whole.
    pub fn advance(&self, count: u64) {
        let before = self.done.fetch_add(count, Ordering::Relaxed);
        let tenths = |done: u64| u128::from(done) * 10 / u128::from(self.total.max(1));
        self.bar.inc(count);
        if self.bar.is_hidden() && tenths(before + count) > tenths(before) {
            let (name, total, seconds) = (self.name, self.total, self.began.elapsed().as_secs());
            println!("certificate {name}: {} of {total} after {seconds} s", before + count);
        }
    }

    /// Ends the run with a line for the table.
    pub fn finish(self, result: impl Display) {
        self.bar.finish_and_clear();
        let seed = self.seed.get().map(|seed| format!(", seed {seed}")).unwrap_or_default();
        println!("certificate {}: {result}{seed}, {:.0} s", self.name, self.began.elapsed().as_secs_f64());
    }
}
