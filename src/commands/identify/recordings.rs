//! Cycles under control in recordings, as the identification needs them.

use std::path::PathBuf;

use nalgebra::Vector3;

use crate::commands::failure::Failure;
use hexad_client::messages::CycleMessage;
use hexad_core::model::LEGS;
use hexad_daemon::recording::Item;
use hexad_daemon::recording::reader::{Recording, with_cycles};
use hexad_machine::analysis::drive_delay::{MeasuredMotion, RecordedStretch};
use hexad_machine::analysis::force_integrals::SentForce;
use hexad_machine::config::Config;

/// Stretches of recordings, and the configuration of the newest recording.
#[derive(Default)]
pub(super) struct Recorded {
    /// Configuration and its text.
    pub configuration: Option<(Config, String)>,
}

impl Recorded {
    /// Reads recordings of one machine.
    pub fn read(&mut self, paths: &[PathBuf]) -> Result<Vec<RecordedStretch>, Failure> {
        let mut stretches = vec![];
        for (recording, _) in with_cycles(paths)? {
            stretches.append(&mut self.read_one(&recording)?);
        }
        Ok(stretches)
    }

    fn read_one(&mut self, recording: &Recording) -> Result<Vec<RecordedStretch>, Failure> {
        let mut reader = StretchReader::default();
        let summary = recording.each(|item| match item {
            Item::Cycle(cycle) => reader.add(&cycle),
            Item::Gap(_) => reader.end(),
            Item::Memory { .. } => {}
        })?;
        recording.remark(&summary);
        reader.end();
        let text = summary.info.configuration;
        let config = Config::parse(&text, "configuration of the recording")?;
        if let Some((other, _)) = &self.configuration {
            if other.name != config.name {
                return Err(Failure::after_start(format_args!(
                    "recordings of two machines: {} and {}; identify each alone",
                    other.name, config.name
                )));
            }
            // The recorded poses were computed from them.
            if joints(other) != joints(&config) {
                return Err(Failure::after_start(format_args!(
                    "{} was recorded with other joints (leg.base_m, leg.platform_m) than the recordings before it; record all with \
                     one file",
                    recording.path().display()
                )));
            }
        }
        self.configuration = Some((config, text));
        Ok(reader.stretches)
    }
}

/// Joint centres of base and platform.
fn joints(config: &Config) -> [[Vector3<f64>; LEGS]; 2] {
    let joints = &config.machine.joints;
    [&joints.base, &joints.platform].map(|centers| joints.triples.unpack_vectors(centers))
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
        sent.push(SentForce { release_ns: input.release_ns, force_n: output.command_n });
        let (Some(measurement), Some(platform), Some(reference)) =
            (input.measurement, output.platform, output.reference)
        else {
            return;
        };
        let is_new = measured.last().is_none_or(|last| last.time_ns < measurement.time_ns);
        if is_new && !missed {
            let (time_ns, length_m) = (measurement.time_ns, measurement.length_m);
            measured.push(MeasuredMotion { time_ns, length_m, pose: platform.pose, reference });
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
