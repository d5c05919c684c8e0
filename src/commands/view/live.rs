//! Content of a live page: the samples of the last minute, and the history since the start of the command.

use std::collections::VecDeque;

use serde::Serialize;

use super::cause_of_silence;
use crate::commands::report::head::json;
use crate::commands::report::history::{Bars, History};
use crate::commands::report::levels::{Extent, Level};
use crate::commands::report::list::{Row, rows};
use crate::commands::report::signals::{CycleInstants, Signals};
use crate::commands::report::summary::{Fact, live_facts};
use crate::commands::report::track::Track;
use crate::output::page::append_base64;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{CycleMessage, LoopCounters, LoopTimes, StatusMessage};
use hexad_core::control::signals::time::seconds_between;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;

/// Least time between two samples \[s\], short enough for the eye.
const SAMPLE_S: f64 = 0.01;

/// Duration of the samples that a newly opened page receives \[s\].
const KEPT_S: f64 = 60.0;

/// Duration for which intervals are kept \[s\], as long as a page shows them.
const INTERVALS_S: f64 = 120.0;

/// Age of the newest data beyond which the page shows no present state \[s\].
const MAX_AGE_S: f64 = 1.0;

/// State of the live page.
pub struct Live<'a> {
    config: &'a Config,
    coordinates: Coordinates,
    history: History,
    signals: Signals<'a>,
    /// Cycles per sample.
    step: u64,
    /// The incomplete pair of samples, with its number.
    pair: Option<(u64, Level)>,
    /// Complete pairs of samples, each with the number of its first.
    pairs: VecDeque<(u64, Level)>,
    counters: LoopCounters,
    pub times: LoopTimes,
    /// Number of the run, raised when the daemon changes.
    run: u64,
    /// Epoch of the daemon's messages.
    epoch: u64,
    /// CLOCK_MONOTONIC instant of the newest data, of their arrival in simulated time; at first the start of the command \[ns\].
    newest_ns: u64,
}

/// Reply to a page, as JSON.
#[derive(Serialize)]
struct Fresh<'a> {
    run: u64,
    /// Age of the newest data.
    age_s: f64,
    /// Why there are no new data; empty if there are.
    silence: String,
    length_s: f64,
    step_s: f64,
    /// Number of the first sample.
    first: u64,
    /// The samples, one after another, in base64.
    samples: String,
    facts: Vec<Fact>,
    tracks: Vec<&'a Track>,
    rows: Vec<Row>,
    distributions: Vec<Bars>,
}

impl<'a> Live<'a> {
    /// Live page before the first cycle, with these coordinates.
    pub fn new(config: &'a Config, coordinates: Coordinates) -> Self {
        let rate_hz = config.deployment.realtime.rate_hz;
        Self {
            config,
            history: History::new(config),
            // The reference is the setpoint at the release.
            signals: Signals::new(&config.machine, CycleInstants::default(), coordinates.clone()),
            coordinates,
            step: (SAMPLE_S * rate_hz).round().max(1.0) as u64,
            pair: None,
            pairs: VecDeque::new(),
            counters: LoopCounters::default(),
            times: LoopTimes::default(),
            run: 0,
            epoch: 0,
            newest_ns: monotonic_ns(),
        }
    }

    /// Adds a cycle.
    pub fn add(&mut self, cycle: &CycleMessage, status: &StatusMessage) {
        if status.header.epoch != self.epoch {
            // Another daemon has begun.
            let (run, epoch) = (self.run + 1, status.header.epoch);
            *self = Self { run, epoch, ..Self::new(self.config, self.coordinates.clone()) };
        }
        // The times belong to other cycles. They are shown but not counted.
        let untimed = CycleMessage { wakeup_ns: 0, compute_ns: 0, ..*cycle };
        let is_first = self.history.cycles == 0;
        if !self.history.add(&untimed) {
            return;
        }
        let is_simulated = self.config.deployment.realtime.is_simulated();
        self.newest_ns = if is_simulated { monotonic_ns() } else { status.header.time_ns };
        let before = core::mem::replace(&mut self.counters, status.counters);
        if !is_first {
            let late = self.counters.late_wakeups.saturating_sub(before.late_wakeups);
            let overruns = self.counters.overruns.saturating_sub(before.overruns);
            self.history.add_counted(self.history.length_s(), late, overruns);
        }
        self.add_samples(cycle);
        self.history.forget_before(self.history.length_s() - INTERVALS_S);
    }

    fn add_samples(&mut self, cycle: &CycleMessage) {
        let (index, row) = (self.history.index(cycle), self.signals.row(cycle));
        let number = index / (2 * self.step) * 2;
        if self.pair.as_ref().is_some_and(|(first, _)| *first != number) {
            self.pairs.extend(self.pair.take());
        }
        let extent = Extent { first: number * self.step, step: self.step, samples: 2 };
        let (_, level) = self.pair.get_or_insert_with(|| (number, Level::new(extent)));
        level.add(index, &row);
        let oldest = number.saturating_sub((KEPT_S / self.step_s()) as u64);
        while self.pairs.front().is_some_and(|(first, _)| *first < oldest) {
            self.pairs.pop_front();
        }
    }

    fn step_s(&self) -> f64 {
        self.step as f64 * self.config.deployment.realtime.period_s()
    }

    /// Samples from a number on, with the history, as JSON.
    pub fn since(&self, after: u64) -> String {
        let fresh = || self.pairs.iter().skip_while(move |(number, _)| *number < after);
        // Samples are consecutive; missing ones are NaN.
        let first = fresh().next().map_or(after, |(number, _)| *number);
        let mut bytes: Vec<u8> = vec![];
        let mut next = first;
        for (number, level) in fresh() {
            let empty = Level::new(level.extent);
            let missing = (next..*number).map(|_| empty.sample(0).collect::<Vec<_>>());
            let samples = [0, 1].map(|sample| level.sample(sample).collect());
            for numbers in missing.chain(samples) {
                bytes.extend(numbers.iter().flat_map(|number: &f32| number.to_le_bytes()));
            }
            next = number + 2;
        }
        let mut samples = String::new();
        append_base64(&mut samples, &bytes);
        let LoopTimes { wakeup_ns, compute_ns, measured_age_ns, end_to_end_ns } = self.times;
        let distributions = [
            ("wake-up", wakeup_ns),
            ("compute", compute_ns),
            ("release to force sent", end_to_end_ns),
            ("age of the measurement", measured_age_ns),
        ];
        let age_s = seconds_between(self.newest_ns, monotonic_ns());
        json(&Fresh {
            run: self.run,
            age_s,
            silence: if age_s > MAX_AGE_S { cause_of_silence(self.config) } else { String::new() },
            length_s: self.history.length_s(),
            step_s: self.step_s(),
            first,
            samples,
            facts: live_facts(self.config, &self.history, &[wakeup_ns, compute_ns], None),
            tracks: self.history.tracks(),
            rows: rows(&self.history),
            distributions: distributions.map(|(name, times)| Bars { name, times, bars: vec![] }).into(),
        })
    }
}
