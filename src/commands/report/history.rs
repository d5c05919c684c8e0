//! History of a run: states, diagnostics, limits, missed deadlines and times of all cycles.

use serde::Serialize;

use super::deadlines::Deadlines;
use super::signals::norms;
use super::track::Track;
use hexad_client::messages::{CycleMessage, Times};
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::limits::{Limit, LimitSet};
use hexad_core::control::signals::state::{Request, State};
use hexad_core::control::signals::time::seconds_between;
use hexad_daemon::report::TrackingSum;
use hexad_daemon::time_histogram::TimeHistogram;
use hexad_machine::config::Config;

/// Bars of a distribution for each decade of time.
const BARS_PER_DECADE: f64 = 20.0;

/// Distribution of a time.
#[derive(Default)]
pub struct Distribution {
    histogram: TimeHistogram,
}

/// Bars of a distribution with its percentiles.
#[derive(Serialize)]
pub struct Bars {
    /// Name of the time.
    pub name: &'static str,
    /// Percentiles.
    pub times: Times,
    /// Upper end of each bar \[µs\] with its number of cycles; empty if only the percentiles are available.
    pub bars: Vec<(f64, u64)>,
}

/// Fault of a run.
#[derive(Clone, Debug)]
pub struct Fault {
    /// Index of the cycle.
    pub index: u64,
    /// Instant of the cycle \[s\].
    pub t: f64,
    /// The diagnostic as a sentence.
    pub text: String,
}

/// History of a run.
pub struct History {
    period_s: f64,
    deadlines: Deadlines,
    first: CycleMessage,
    last: CycleMessage,
    /// Number of cycles.
    pub cycles: u64,
    /// Number of cycles that are missing in the recording.
    pub lost: u64,
    /// Whether its last file broke off: what followed the last cycle is unknown.
    pub is_unfinished: bool,
    /// Faults in the order of time.
    pub faults: Vec<Fault>,
    /// Tracking error of the cycles in state active.
    pub tracking: TrackingSum,
    /// Number of cycles in each state.
    in_state: [u64; State::ALL.len()],
    states: Track,
    /// Number of the configuration and its changes, if there are several.
    configuration: Option<(u32, String)>,
    configurations: Track,
    diagnostics: Track,
    requests: Track,
    limits: Vec<(Limit, Track)>,
    missed: [Track; 4],
    lost_track: Track,
    distributions: [(&'static str, Distribution); 4],
    /// Indices of the changes of state, and of the cycles with the largest tracking error and the latest output.
    changes: Vec<u64>,
    worst_error: (f64, u64),
    worst_time: (u64, u64),
}

/// Largest number of state changes around which every cycle is kept.
const MAX_CHANGES: usize = 64;

impl History {
    /// History without cycles.
    pub fn new(config: &Config) -> Self {
        let period_s = config.deployment.realtime.period_s();
        // Consecutive cycles, however much their releases vary, are one interval.
        let gap = 1.5 * period_s;
        let missed = ["late wake-up", "overrun", "release skipped", "inputs late"];
        Self {
            period_s,
            deadlines: Deadlines::new(config),
            first: CycleMessage::default(),
            last: CycleMessage::default(),
            cycles: 0,
            lost: 0,
            is_unfinished: false,
            faults: vec![],
            tracking: TrackingSum::default(),
            in_state: [0; State::ALL.len()],
            // A state lasts until the next one, even if releases are skipped.
            states: Track::new("state", "state", f64::INFINITY),
            configuration: None,
            configurations: Track::new("configuration", "configuration", f64::INFINITY),
            diagnostics: Track::new("diagnostic", "diagnostic", gap),
            requests: Track::new("requests", "request", gap),
            limits: Limit::ALL.map(|limit| (limit, Track::new("limits reached", limit.name(), gap))).into(),
            missed: missed.map(|name| Track::new("missed deadlines", name, gap)),
            lost_track: Track::new("recording", "cycles missing", gap),
            distributions: ["wake-up", "compute", "release to output", "age of the measurement"]
                .map(|name| (name, Distribution::default())),
            changes: vec![],
            worst_error: (0.0, 0),
            worst_time: (0, 0),
        }
    }

    /// Begins another configuration with the next cycle. `changes` are those of the reload, empty for the
    /// first.
    pub fn begin_configuration(&mut self, number: u32, changes: &str) {
        let text = if changes.is_empty() { "as started".into() } else { format!("reloaded: {changes}") };
        self.configuration = Some((number, text));
    }

    /// Instant of a cycle \[s\], since the first one.
    pub fn seconds(&self, cycle: &CycleMessage) -> f64 {
        seconds_between(self.first.release_ns, cycle.release_ns)
    }

    /// Index of a cycle on the grid of the releases.
    pub fn index(&self, cycle: &CycleMessage) -> u64 {
        (self.seconds(cycle) / self.period_s).round().max(0.0) as u64
    }

    /// CLOCK_MONOTONIC instant of the first cycle \[ns\].
    pub fn begin_ns(&self) -> u64 {
        self.first.due_ns
    }

    /// Number of points of the grid from the first to the last cycle.
    pub fn span(&self) -> u64 {
        self.index(&self.last) + 1
    }

    /// Length \[s\].
    pub fn length_s(&self) -> f64 {
        self.seconds(&self.last)
    }

    /// State in the last cycle.
    pub fn last_state(&self) -> State {
        State::from_number(self.last.state).unwrap_or_default()
    }

    /// Adds the next cycle. False if it is not later than the previous ones.
    pub fn add(&mut self, cycle: &CycleMessage) -> bool {
        if self.cycles == 0 {
            (self.first, self.last) = (*cycle, *cycle);
        } else if cycle.cycle <= self.last.cycle || cycle.release_ns <= self.last.release_ns {
            return false;
        }
        let t = self.seconds(cycle);
        self.add_timing(cycle, t);
        self.add_state(cycle, t);
        self.cycles += 1;
        self.last = *cycle;
        true
    }

    fn add_timing(&mut self, cycle: &CycleMessage, t: f64) {
        let period_s = self.period_s;
        let missed = self.deadlines.check(cycle);
        let output_ns = cycle.wakeup_ns + cycle.compute_ns;
        let age_ns =
            (cycle.has_measurement == 1).then(|| cycle.release_ns.saturating_sub(cycle.measured_time_ns));
        let times = [Some(cycle.wakeup_ns), Some(cycle.compute_ns), Some(output_ns), age_ns];
        for ((_, distribution), time_ns) in self.distributions.iter_mut().zip(times) {
            time_ns.into_iter().for_each(|time_ns| distribution.histogram.record(time_ns));
        }
        if output_ns > self.worst_time.0 {
            self.worst_time = (output_ns, self.index(cycle));
        }
        let micros = |time_ns: u64| format!("{:.1} µs", time_ns as f64 * 1e-3);
        let [late, overrun, skipped, inputs] = &mut self.missed;
        if missed.is_late {
            late.add(t, t, 1, || format!("cycle {} woke {} late", cycle.cycle, micros(cycle.wakeup_ns)));
        }
        if missed.is_overrun {
            overrun.add(t, t, 1, || {
                format!("cycle {} had its output {} after its release", cycle.cycle, micros(output_ns))
            });
        }
        if cycle.io_late == 1 {
            inputs.add(t, t, 1, || format!("cycle {} used the inputs of the cycle before", cycle.cycle));
        }
        if self.cycles > 0 {
            let before = seconds_between(self.first.release_ns, self.last.release_ns);
            let lost = cycle.cycle - self.last.cycle - 1;
            let points = ((t - before) / period_s).round() as u64;
            let without = points.saturating_sub(lost + 1);
            if lost > 0 {
                self.lost_track.add(before + period_s, t, 1, || format!("{lost} cycles are missing"));
                self.lost += lost;
            } else if self.deadlines.has_grid() && without > 0 {
                skipped.add(before + period_s, t, 1, || format!("no cycle at {without} releases"));
                skipped.count += without - 1;
            }
        }
    }

    fn add_state(&mut self, cycle: &CycleMessage, t: f64) {
        let index = self.index(cycle);
        if (self.cycles == 0 || cycle.state != self.last.state) && self.changes.len() < MAX_CHANGES {
            self.changes.push(index);
        }
        let state = State::from_number(cycle.state).unwrap_or_default();
        self.states.add(t, t, cycle.state, || state.name().into());
        self.in_state.get_mut(state as usize).into_iter().for_each(|cycles| *cycles += 1);
        if let Some((number, text)) = &self.configuration {
            self.configurations.add(t, t, *number, || text.clone());
        }
        let diagnostic = cycle.diagnostic.diagnostic().unwrap_or_default();
        if diagnostic.code != DiagnosticCode::None {
            let key = 1000 * diagnostic.index + diagnostic.code as u32;
            self.diagnostics.add(t, t, key, || diagnostic.to_string());
        }
        if state == State::Fault && (self.cycles == 0 || cycle.state != self.last.state) {
            self.faults.push(Fault { index, t, text: diagnostic.to_string() });
        }
        if let Some(request) = Request::from_number(cycle.request).filter(|_| cycle.has_request == 1) {
            let is_new = self.cycles == 0
                || (cycle.request_epoch, cycle.request_sequence)
                    != (self.last.request_epoch, self.last.request_sequence);
            if is_new {
                self.requests.add(t, t, request as u32, || request.name().into());
            }
        }
        for (limit, track) in &mut self.limits {
            if LimitSet(cycle.active_limits).contains(*limit) {
                track.add(t, t, 1, || limit.name().into());
            }
        }
        if state == State::Active
            && let Some(error) = cycle.output().and_then(|output| output.error)
        {
            let (position, orientation) = norms(&error.pose);
            self.tracking.add(position, orientation);
            if position > self.worst_error.0 {
                self.worst_error = (position, index);
            }
        }
    }

    /// Tracks with at least one interval, states first. Every interval ends with its last cycle.
    pub fn tracks(&self) -> Vec<&Track> {
        let limits = self.limits.iter().map(|(_, track)| track);
        let all =
            [&self.states, &self.configurations, &self.diagnostics, &self.requests].into_iter().chain(limits);
        all.chain(&self.missed)
            .chain([&self.lost_track])
            .filter(|track| !track.intervals.is_empty())
            .collect()
    }

    /// Numbers of late wake-ups, overruns, skipped releases and cycles without new inputs.
    pub fn missed(&self) -> [u64; 4] {
        [0, 1, 2, 3].map(|kind: usize| self.missed.get(kind).map_or(0, |track| track.count))
    }

    /// Time in each state that occurred \[s\].
    pub fn time_in_states(&self) -> Vec<(State, f64)> {
        let lengths = self.in_state.iter().map(|cycles| *cycles as f64 * self.period_s);
        State::ALL.into_iter().zip(lengths).filter(|(_, length)| *length > 0.0).collect()
    }

    /// Adds late wake-ups and overruns counted by a daemon before an instant \[s\].
    pub fn add_counted(&mut self, t: f64, late_wakeups: u64, overruns: u64) {
        let [late, overrun, ..] = &mut self.missed;
        for (track, number) in [(late, late_wakeups), (overrun, overruns)] {
            if number > 0 {
                track.add(t, t, 1, || format!("{number}, counted by the daemon"));
                track.count += number - 1;
            }
        }
    }

    /// Drops the intervals that ended before an instant \[s\].
    pub fn forget_before(&mut self, t: f64) {
        let limits = self.limits.iter_mut().map(|(_, track)| track);
        let all = [&mut self.states, &mut self.diagnostics, &mut self.requests, &mut self.lost_track];
        for track in all.into_iter().chain(limits).chain(&mut self.missed) {
            track.intervals.retain(|interval| interval.to >= t);
        }
    }

    /// Distributions of the times.
    pub fn distributions(&self) -> Vec<Bars> {
        self.distributions
            .iter()
            .map(|(name, of)| Bars { name, times: of.histogram.times(), bars: of.bars() })
            .collect()
    }

    /// Percentiles of wake-up and computation \[ns\].
    pub fn times(&self) -> [Times; 2] {
        let [(_, wakeup), (_, compute), ..] = &self.distributions;
        [wakeup.histogram.times(), compute.histogram.times()]
    }

    /// Indices of the cycles around which every cycle is kept, the most important first: faults, the largest
    /// tracking error, the latest output, changes of state.
    pub fn events(&self) -> Vec<u64> {
        let worst = [self.worst_error.1, self.worst_time.1];
        self.faults.iter().map(|fault| fault.index).chain(worst).chain(self.changes.iter().copied()).collect()
    }
}

impl Distribution {
    /// Bars of equal width on a logarithmic axis.
    fn bars(&self) -> Vec<(f64, u64)> {
        let mut bars: Vec<(f64, u64)> = vec![];
        for (time_ns, count) in self.histogram.counts() {
            let bar = ((time_ns.max(1) as f64).log10() * BARS_PER_DECADE).ceil() / BARS_PER_DECADE;
            let end_us = 10_f64.powf(bar - 3.0);
            match bars.last_mut() {
                Some((end, sum)) if *end == end_us => *sum += count,
                _ => bars.push((end_us, count)),
            }
        }
        bars
    }
}
