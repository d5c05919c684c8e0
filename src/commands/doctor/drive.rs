//! `hexad doctor --drive`: delay of the drives from recordings of a motion.

use core::fmt::Write as _;
use std::path::PathBuf;

use serde::Serialize;

use crate::analysis::drive_delay::{
    DriveDelay, Estimate, MeasuredMotion, RecordedStretch, SentForce, drive_delay,
};
use crate::commands::failure::{CommandError, Failure};
use crate::config::Config;
use crate::messages::CycleMessage;
use crate::output::files::{print, print_json, write_json};
use crate::recording::Item;
use crate::recording::reader::Recording;

/// Largest double standard deviation of a determined delay, as a ratio of the delay and \[s\]. Half a
/// millisecond more or less hardly affects the loop.
/// next to nothing.
const MAX_UNCERTAINTY_RATIO: f64 = 0.1;
const MAX_UNCERTAINTY_S: f64 = 5e-4;

/// Reason why no delay is determined.
#[derive(Debug, thiserror::Error)]
enum DriveError {
    #[error(
        "too little motion under control is recorded; record 20 s or more of `hexad move --motion sines`"
    )]
    TooLittle,
    #[error("recordings of two machines: {0} and {1}; measure each alone")]
    TwoMachines(String, String),
    #[error(
        "the motion does not show the delay: {:.2} ms with a standard deviation of {:.2} ms; record a longer or faster one, such as \
         `hexad move --motion sines`, with larger [limits]", 1e3 * .0.delay_s, 1e3 * .0.deviation_s
    )]
    Uncertain(Estimate),
}

impl CommandError for DriveError {
    fn has_begun(&self) -> bool {
        true
    }
}

/// Result as JSON.
#[derive(Serialize)]
struct Report {
    delay_us: f64,
    deviation_us: f64,
    leg_delay_us: [f64; 6],
    leg_deviation_us: [f64; 6],
    duration_s: f64,
}

/// Measures the delay, and prints it as text or writes it as JSON.
pub fn run(recordings: &[PathBuf], json: bool, report: Option<&PathBuf>) -> Result<(), Failure> {
    let (mut stretches, mut config): (_, Option<Config>) = (vec![], None);
    for path in recordings {
        let recording = Recording::open(path)?;
        let mut reader = StretchReader::default();
        let summary = recording.each(|item| match item {
            Item::Cycle(cycle) => reader.add(&cycle),
            Item::Gap(_) => reader.end(),
            Item::Memory { .. } => {}
        })?;
        reader.end();
        stretches.append(&mut reader.stretches);
        let recorded = Config::parse(&summary.info.configuration, "configuration of the recording")?;
        if let Some(other) = config.filter(|other| other.name != recorded.name) {
            return Err(DriveError::TwoMachines(other.name, recorded.name).into());
        }
        config = Some(recorded);
    }
    let config = config.ok_or(DriveError::TooLittle)?;
    let found = drive_delay(&config.machine, &stretches).ok_or(DriveError::TooLittle)?;
    let Estimate { delay_s, deviation_s } = found.mean;
    if !(2.0 * deviation_s <= MAX_UNCERTAINTY_S.max(MAX_UNCERTAINTY_RATIO * delay_s)) {
        return Err(DriveError::Uncertain(found.mean).into());
    }
    let contents = Report {
        delay_us: 1e6 * delay_s,
        deviation_us: 1e6 * deviation_s,
        leg_delay_us: found.legs.map(|leg| 1e6 * leg.delay_s),
        leg_deviation_us: found.legs.map(|leg| 1e6 * leg.deviation_s),
        duration_s: found.duration_s,
    };
    if let Some(path) = report {
        write_json(path, &contents)?;
    }
    match json {
        true => print_json(&contents)?,
        false => print(text(&config, &found))?,
    }
    Ok(())
}

fn text(config: &Config, DriveDelay { mean, legs, duration_s }: &DriveDelay) -> String {
    let lag_s = config.deployment.drive.lag_s;
    let mut text = format!(
        "{}: {duration_s:.0} s of motion under control\nrelease to force  {:.3} ms, standard deviation {:.3} ms\n",
        config.name,
        1e3 * mean.delay_s,
        1e3 * mean.deviation_s
    );
    for (leg, Estimate { delay_s, deviation_s }) in legs.iter().enumerate() {
        let _ = writeln!(
            text,
            "  leg {}           {:.3} ms +- {:.3} ms",
            leg + 1,
            1e3 * delay_s,
            1e3 * deviation_s
        );
    }
    let configured = match config.deployment.drive.delay_s {
        Some(delay_s) => format!("was {:.0}", 1e6 * delay_s),
        None => "was not given".into(),
    };
    let lag = if lag_s > 0.0 { ", less lag_us" } else { "" };
    let delay_us = (1e6 * (mean.delay_s - lag_s)).max(0.0);
    let _ = writeln!(text, "\n[drive]\ndelay_us = {delay_us:.0}   # {configured}{lag}");
    text
}

/// Reader that collects cycles under control.
#[derive(Default)]
struct StretchReader {
    stretches: Vec<RecordedStretch>,
    current: RecordedStretch,
    /// Number of the last cycle, and its count of missed measurements.
    last: Option<(u64, u64)>,
}

impl StretchReader {
    fn add(&mut self, cycle: &CycleMessage) {
        let (Some(input), Some(output)) = (cycle.input(), cycle.output()) else { return self.end() };
        let continues = self.last.is_some_and(|(number, _)| number + 1 == cycle.cycle);
        if !output.state.has_control() || !continues {
            self.end();
        }
        let missed = self.last.is_some_and(|(_, missed)| missed != output.missed_measurements);
        self.last = Some((cycle.cycle, output.missed_measurements));
        if !output.state.has_control() {
            return;
        }
        let RecordedStretch { sent, measured } = &mut self.current;
        sent.push(SentForce { release_ns: input.release_ns, force: output.force });
        let (Some(measurement), Some(platform), Some(reference)) =
            (input.measurement, output.platform, output.reference)
        else {
            return;
        };
        let is_new = measured.last().is_none_or(|last| last.time_ns < measurement.time_ns);
        if is_new && !missed {
            let (time_ns, length) = (measurement.time_ns, measurement.length);
            measured.push(MeasuredMotion { time_ns, length, pose: platform.pose, reference });
        }
    }

    fn end(&mut self) {
        self.last = None;
        let stretch = core::mem::take(&mut self.current);
        if !stretch.sent.is_empty() {
            self.stretches.push(stretch);
        }
    }
}
