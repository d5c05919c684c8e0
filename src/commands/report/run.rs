//! A run in its files, including changes of the configuration.

use std::path::PathBuf;

use super::ReportError;
use super::history::History;
use super::levels::{self, Level};
use super::signals::{CycleInstants, Signals};
use hexad_daemon::recording::reader::{Recording, Summary, with_cycles};
use hexad_daemon::recording::{Item, RecordingError, RunInfo};
use hexad_machine::config::Config;
use hexad_machine::config::changes::changes;
use hexad_machine::config::coordinates::Coordinates;

/// Part of a run with one configuration.
pub struct Part {
    /// Information in the head of its files.
    pub info: RunInfo,
    /// The configuration.
    pub config: Config,
    /// Files in the order of time.
    files: Vec<PathBuf>,
    /// Number of the first cycle in the files.
    pub first_cycle: u64,
    /// Instant of that cycle \[s\], since the first of the run.
    pub from_s: f64,
    /// Changes of the reload, as text; empty for the first part.
    pub changes: String,
}

/// A run in its files.
pub struct Run {
    first: Part,
    later: Vec<Part>,
    /// History of the run.
    pub history: History,
}

impl Run {
    /// Reads the history. All files must be of one run of a daemon.
    pub fn read(recordings: &[PathBuf]) -> Result<Self, ReportError> {
        let mut files = with_cycles(recordings)?;
        files.iter().for_each(|(recording, summary)| recording.remark(summary));
        files.sort_by_key(|(_, summary)| summary.first.release_ns);
        let mut files =
            files.into_iter().map(|(recording, summary)| (recording.path().to_path_buf(), summary));
        let Some((first_path, summary)) = files.next() else {
            return Err(RecordingError::Empty(PathBuf::new()).into());
        };
        let mut newest = Part::new(first_path.clone(), summary, None)?;
        let mut ended = vec![];
        for (path, summary) in files {
            if !is_of_run(&summary.info, &newest.info) {
                return Err(ReportError::OtherRun(path, first_path));
            }
            if summary.info == newest.info {
                newest.files.push(path);
            } else {
                let next = Part::new(path, summary, Some(&newest))?;
                ended.push(core::mem::replace(&mut newest, next));
            }
        }
        ended.push(newest);
        let mut parts = ended.into_iter();
        let Some(first) = parts.next() else { return Err(RecordingError::Empty(first_path).into()) };
        let history = History::new(&first.config);
        let mut run = Self { first, later: parts.collect(), history };
        run.read_history()?;
        Ok(run)
    }

    fn read_history(&mut self) -> Result<(), ReportError> {
        let Self { first, later, history } = self;
        let is_changed = !later.is_empty();
        for (number, part) in (1..).zip(core::iter::once(first).chain(later)) {
            if is_changed {
                history.begin_configuration(number, &part.changes);
            }
            let mut is_begun = false;
            for file in &part.files {
                let cycles = history.cycles;
                let summary = Recording::open(file)?.each(|item| {
                    if let Item::Cycle(cycle) = item
                        && history.add(&cycle)
                        && !core::mem::replace(&mut is_begun, true)
                    {
                        part.from_s = history.seconds(&cycle);
                        part.first_cycle = cycle.cycle;
                    }
                })?;
                // Only the next file of the run shows how it went on; the window of a fault ends by itself.
                let (is_newer, is_window) = (history.cycles > cycles, summary.fault.is_some());
                if summary.is_broken_off && (is_newer || !is_window) {
                    history.is_unfinished = true;
                } else if is_newer && !is_window {
                    history.is_unfinished = false;
                }
            }
        }
        Ok(())
    }

    /// Information in the head of the first files.
    pub fn info(&self) -> &RunInfo {
        &self.first.info
    }

    /// Unix time of the first cycle \[s\].
    pub fn begin_s(&self) -> f64 {
        self.history.begin_ns().wrapping_add(self.info().clock_offset_ns) as f64 * 1e-9
    }

    /// The first configuration. A reload changes neither the machine nor the rate.
    pub fn config(&self) -> &Config {
        &self.first.config
    }

    /// The parts with one configuration each, in the order of time.
    pub fn parts(&self) -> impl Iterator<Item = &Part> {
        core::iter::once(&self.first).chain(&self.later)
    }

    /// The samples kept, in at most `max_bytes`.
    pub fn levels(&self, max_bytes: usize) -> Result<Vec<Level>, ReportError> {
        let history = &self.history;
        let rate_hz = self.config().deployment.realtime.rate_hz;
        let extents = levels::plan(history.span(), &history.events(), rate_hz, max_bytes);
        let mut levels: Vec<_> = extents.into_iter().map(Level::new).collect();
        let mut last = 0;
        for Part { config, files, .. } in self.parts() {
            let mut signals =
                Signals::new(&config.machine, CycleInstants::of_controller(config), Coordinates::default());
            for file in files {
                Recording::open(file)?.each(|item| {
                    if let Item::Cycle(cycle) = item
                        && cycle.cycle > last
                    {
                        last = cycle.cycle;
                        let (index, row) = (history.index(&cycle), signals.row(&cycle));
                        levels.iter_mut().for_each(|level| level.add(index, &row));
                    }
                })?;
            }
        }
        Ok(levels)
    }

    /// The configuration as the daemon read it. Each of several is preceded by a line with its time.
    pub fn configurations(&self) -> String {
        if self.later.is_empty() {
            return self.config().text.clone();
        }
        let texts = (1..).zip(self.parts()).map(|(number, part)| {
            let Part { config, first_cycle, from_s, .. } = part;
            format!("# Configuration {number}, from {from_s:.3} s (cycle {first_cycle})\n\n{}", config.text)
        });
        texts.collect::<Vec<_>>().join("\n\n")
    }
}

impl Part {
    /// Part with its first file, after another part.
    fn new(path: PathBuf, summary: Summary, before: Option<&Self>) -> Result<Self, ReportError> {
        let Summary { info, first, .. } = summary;
        let config = Config::parse(&info.configuration, "configuration of the recording")?;
        let changes = before.map_or(vec![], |before| changes(&before.config.text, &config.text));
        let changes = changes.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let changes = if before.is_some() && changes.is_empty() { "no key".into() } else { changes };
        Ok(Self { info, config, files: vec![path], first_cycle: first.cycle, from_s: 0.0, changes })
    }
}

/// Whether files are of one run of a daemon: the offset of their clocks is equal to the nanosecond. A reload
/// may change the configuration, and with it the fidelity.
fn is_of_run(info: &RunInfo, other: &RunInfo) -> bool {
    let of_run = |info: &RunInfo| {
        let RunInfo { name, version, commit, instruction_set, clock_offset_ns, .. } = info.clone();
        (name, version, commit, instruction_set, clock_offset_ns)
    };
    of_run(info) == of_run(other)
}
