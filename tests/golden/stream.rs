//! Streams in files: inputs in `NAME.bin`, the configuration of their controller in `NAME.toml`.
//!
//! A `.bin` is a column of the file's words after the other, each of [`CYCLES`] words ([`codec`], [`input_words`]).

use std::path::{Path, PathBuf};
use std::{fs, thread};

use fearless_simd::Level;
use hexad::config::Config;
use hexad::control::controller::{Controller, Output};
use hexad::control::signals::inputs::Input;
use hexad::realtime::setup::denormals;
use rayon::prelude::*;

use super::codec;
use super::input_words::{self, Row, WORDS};
use crate::common::rig::parameters;

/// Cycles of each stream.
pub const CYCLES: usize = 2000;

pub struct Stream {
    pub name: String,
    /// Text of the configuration.
    pub configuration: String,
    pub inputs: Vec<Input>,
}

/// Folder of the streams.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/streams")
}

/// Every stream, in the order of their names.
pub fn all() -> Vec<Stream> {
    let files = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = files.filter(|file| file.extension().is_some_and(|it| it == "bin")).collect();
    files.sort();
    files.iter().map(|file| Stream::read(file)).collect()
}

impl Stream {
    pub fn read(file: &Path) -> Self {
        let bytes = fs::read(file).unwrap();
        let mut rest = bytes.as_slice();
        let columns = [(); WORDS].map(|()| codec::read(&mut rest, CYCLES));
        assert!(rest.is_empty(), "{}: bytes after its end", file.display());
        let row = |cycle: usize| -> Row { core::array::from_fn(|word| columns[word][cycle]) };
        Self {
            name: file.file_stem().unwrap().to_string_lossy().into_owned(),
            configuration: fs::read_to_string(file.with_extension("toml")).unwrap(),
            inputs: (0..CYCLES).map(|cycle| input_words::input(&row(cycle))).collect(),
        }
    }

    /// Content of its `.bin`.
    pub fn bytes(&self) -> Vec<u8> {
        let rows = self.inputs.iter().scan([0; WORDS], |before, input| {
            *before = input_words::row(input, before);
            Some(*before)
        });
        let rows: Vec<Row> = rows.collect();
        let mut bytes = vec![];
        for word in 0..WORDS {
            let column: Vec<u64> = rows.iter().map(|row| row[word]).collect();
            codec::write(&mut bytes, &column);
        }
        bytes
    }

    /// What a new controller makes of it whose lanes run on an instruction set.
    pub fn run(self, level: Level) -> Run {
        let place = format!("{}.toml", self.name);
        let config = Config::parse_on(level, &self.configuration, &place);
        let config = config.unwrap_or_else(|error| panic!("{error}"));
        let mut controller = Controller::new(&config.machine, parameters(&config));
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

/// Every stream, computed with lanes on an instruction set.
pub fn run_all(level: Level) -> Vec<Run> {
    all().into_par_iter().map(|stream| stream.run(level)).collect()
}
