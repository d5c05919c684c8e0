//! Streams in files: recordings as hexad writes them, with gzip, whose outputs are zero.
//!
//! The outputs would make a file four times as large, and every change of the controller would make them wrong; `hashes.txt` is about them.
//! `gunzip` makes a recording that `hexad convert`, `report` and `replay` read; `replay` computes its cycles and names every output as different.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::{io, thread};

use fearless_simd::Level;
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::signals::inputs::Input;
use hexad::daemon::recorder::instruction_set;
use hexad::daemon::replay::recorded_controller;
use hexad::daemon::version;
use hexad::messages::CycleMessage;
use hexad::realtime::setup::denormals;
use hexad::recording::file::RecordingFile;
use hexad::recording::reader::{Recording, Summary};
use hexad::recording::{Item, RunInfo};
use hexad_support::rig::parameters;
use rayon::prelude::*;
use tempfile::NamedTempFile;

/// Cycles of each stream.
pub const CYCLES: usize = 2000;

pub struct Stream {
    pub info: RunInfo,
    pub inputs: Vec<Input>,
}

/// Folder of the streams.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/streams")
}

impl Stream {
    pub fn new(config: &Config, inputs: Vec<Input>) -> Self {
        let info = RunInfo {
            name: config.name.clone(),
            version: version::NUMBER.into(),
            instruction_set: instruction_set(config.machine.level),
            fidelity: parameters(config).fidelity.name().into(),
            configuration: config.text.clone(),
            ..RunInfo::default()
        };
        Self { info, inputs }
    }

    fn read(file: &Path) -> Self {
        let mut recording = NamedTempFile::new().unwrap();
        io::copy(&mut GzDecoder::new(File::open(file).unwrap()), &mut recording).unwrap();
        let mut inputs = vec![];
        let summary = Recording::open(recording.path()).unwrap().each(|item| {
            if let Item::Cycle(cycle) = item {
                inputs.push(cycle.input().unwrap());
            }
        });
        let Summary { info, unfinished, .. } = summary.unwrap();
        assert_eq!((inputs.len(), unfinished), (CYCLES, None), "{}", file.display());
        Self { info, inputs }
    }

    pub fn write(&self) {
        let recording = NamedTempFile::new().unwrap();
        self.record(recording.path(), |_, _, _| Some(Output::default()));
        let file = folder().join(&self.info.name).with_extension("mcap.gz");
        let mut packed = GzEncoder::new(File::create(file).unwrap(), Compression::best());
        io::copy(&mut File::open(recording.path()).unwrap(), &mut packed).unwrap();
        packed.finish().unwrap();
    }

    /// Records the inputs with the outputs of a step; without an output the cycle is missing.
    pub fn record(
        &self,
        path: &Path,
        mut step: impl FnMut(&mut RecordingFile, u64, &Input) -> Option<Output>,
    ) {
        let mut file = RecordingFile::create(path, &self.info, None).unwrap();
        for (cycle, input) in (1..).zip(&self.inputs) {
            if let Some(output) = step(&mut file, cycle, input) {
                let message = CycleMessage::new(input, &output);
                file.write_cycle(&CycleMessage { cycle, due_ns: input.release_ns, ..message }).unwrap();
            }
        }
        file.finish().unwrap();
    }

    /// Its configuration, with lanes on an instruction set.
    pub fn config(&self, level: Level) -> Config {
        let config = Config::parse_on(level, &self.info.configuration, &self.info.name);
        config.unwrap_or_else(|error| panic!("{error}"))
    }

    /// What a new controller makes of it whose lanes run on an instruction set.
    fn run(self, level: Level) -> Run {
        let config = self.config(level);
        let mut controller = recorded_controller(&self.info, &config);
        // As in the real-time thread of the daemon denormal numbers count as zero: in a thread of its own, as other tests may
        // follow in this one.
        let step = || {
            denormals::flush();
            self.inputs.iter().map(|input| controller.step(input)).collect()
        };
        let outputs = thread::scope(|scope| scope.spawn(step).join().unwrap());
        Run { stream: self, config, outputs }
    }
}

/// A stream that was computed.
pub struct Run {
    pub stream: Stream,
    pub config: Config,
    pub outputs: Vec<Output>,
}

/// Every stream in the order of their names, computed with lanes on an instruction set.
pub fn run_all(level: Level) -> Vec<Run> {
    let mut files: Vec<_> = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.par_iter().map(|file| Stream::read(file).run(level)).collect()
}
