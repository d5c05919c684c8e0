//! A recording in the making.

use core::sync::atomic::{AtomicU64, Ordering};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};

use super::reader::Recording;
use super::scene::Scene;
use super::{CYCLE, FRAMES, GAP, JOINTS, MEMORY, RecordingError, RunInfo, schema};
use hexad_client::messages::cdr::CdrWriter;
use hexad_client::messages::layout::Declared;
use hexad_client::messages::{CycleMessage, GapMessage};
use hexad_machine::text::files::FileError;

/// Size at which a chunk is written \[bytes\]: what a crash may cost, 0.1 s at 1 kHz; smaller ones take more time.
const CHUNK_BYTES: u64 = 128 * 1024;

/// What MCAP adds to a message at most: head of the record and its entry in the index \[bytes\].
const OVERHEAD_BYTES: u64 = 64;

/// Messages that this process has written to recordings.
static WRITES: AtomicU64 = AtomicU64::new(0);

/// Number of messages that this process has written to recordings: shows whether writing makes progress.
pub fn writes() -> u64 {
    WRITES.load(Ordering::Relaxed)
}

/// Options of every file: chunks are written whole, so that a crash leaves complete ones.
pub(super) fn options() -> WriteOptions {
    WriteOptions::new()
        .profile("ros2")
        .library(concat!("hexad ", env!("CARGO_PKG_VERSION")))
        .compression(None)
        .chunk_size(Some(CHUNK_BYTES))
        .disable_seeking(true)
}

/// Error of MCAP as one of the file.
pub(super) fn on(path: &Path) -> impl Fn(McapError) -> RecordingError + use<> {
    let path = path.to_path_buf();
    move |error| {
        let cause = match error {
            McapError::Io(cause) => cause,
            other => std::io::Error::other(other),
        };
        FileError { path: path.clone(), cause }.into()
    }
}

/// Numbers of the channels.
#[derive(Clone, Copy, Debug)]
struct Channels {
    cycle: u16,
    memory: u16,
    gap: u16,
    frames: u16,
    joints: u16,
}

/// A recording in the making.
pub struct RecordingFile {
    path: PathBuf,
    writer: Writer<File>,
    channels: Channels,
    clock_offset_ns: u64,
    /// Upper bound on the size so far \[bytes\].
    bytes: u64,
    buffer: Vec<u8>,
}

impl RecordingFile {
    /// Creates a file. `fault` is the cycle of the fault whose window it holds. If not even its head can be
    /// written, no file is left.
    pub fn create(path: &Path, info: &RunInfo, fault: Option<u64>) -> Result<Self, RecordingError> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(FileError::on(folder))?;
        }
        Self::write_to(File::create(path).map_err(FileError::on(path))?, path, info, fault)
            .inspect_err(|_| drop(fs::remove_file(path)))
    }

    /// Begins a recording in an open file, which messages call `path`.
    pub fn write_to(
        file: File,
        path: &Path,
        info: &RunInfo,
        fault: Option<u64>,
    ) -> Result<Self, RecordingError> {
        let mut writer = options().create(file).map_err(on(path))?;
        let channels = channels(&mut writer).map_err(on(path))?;
        let fault = fault.map(|cycle| BTreeMap::from([("cycle".into(), cycle.to_string())]));
        let metadata = [("hexad", Some(info.metadata())), ("fault", fault)];
        let mut bytes = 0;
        for (name, metadata) in metadata {
            let Some(metadata) = metadata else { continue };
            bytes += metadata.values().map(|value| value.len() as u64 + OVERHEAD_BYTES).sum::<u64>();
            writer.write_metadata(&Metadata { name: name.into(), metadata }).map_err(on(path))?;
        }
        let (path, clock_offset_ns) = (path.to_path_buf(), info.clock_offset_ns);
        Ok(Self { path, writer, channels, clock_offset_ns, bytes, buffer: vec![] })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Upper bound on its size \[bytes\].
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Writes a cycle.
    pub fn write_cycle(&mut self, cycle: &CycleMessage) -> Result<(), RecordingError> {
        self.write_struct(self.channels.cycle, cycle.due_ns, cycle)
    }

    /// Writes the mark of a gap before a cycle that was due at an instant \[ns\].
    pub fn write_gap(&mut self, due_ns: u64, gap: &GapMessage) -> Result<(), RecordingError> {
        self.write_struct(self.channels.gap, due_ns, gap)
    }

    /// Writes the memory of the controller before a cycle.
    pub fn write_memory(&mut self, cycle: u64, due_ns: u64, memory: &[u8]) -> Result<(), RecordingError> {
        let mut message = self.begin();
        message.u64(cycle);
        message.sequence(memory);
        self.write(self.channels.memory, due_ns, message.finish())
    }

    /// Writes the frames of a cycle with a platform pose, and the joints of a cycle with a measurement.
    pub fn write_scene(&mut self, scene: &Scene, cycle: &CycleMessage) -> Result<(), RecordingError> {
        let time_ns = self.time_ns(cycle.due_ns);
        if let Some(platform) = cycle.output().and_then(|output| output.platform) {
            let message = scene.frames(time_ns, &platform, core::mem::take(&mut self.buffer));
            self.write(self.channels.frames, cycle.due_ns, message)?;
        }
        if cycle.has_measurement == 1 {
            let message = scene.joints(time_ns, cycle, core::mem::take(&mut self.buffer));
            self.write(self.channels.joints, cycle.due_ns, message)?;
        }
        Ok(())
    }

    /// Writes the chunk that has begun.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush().map_err(on(&self.path))
    }

    /// Completes the file.
    pub fn finish(mut self) -> Result<PathBuf, RecordingError> {
        self.writer.finish().map_err(on(&self.path))?;
        Ok(self.path.clone())
    }

    fn time_ns(&self, due_ns: u64) -> u64 {
        due_ns.wrapping_add(self.clock_offset_ns)
    }

    fn begin(&mut self) -> CdrWriter {
        CdrWriter::new(core::mem::take(&mut self.buffer))
    }

    fn write_struct(&mut self, channel: u16, due_ns: u64, of: &impl Declared) -> Result<(), RecordingError> {
        let message = self.begin().bytes(of.bytes()).finish();
        self.write(channel, due_ns, message)
    }

    fn write(&mut self, channel_id: u16, due_ns: u64, message: Vec<u8>) -> Result<(), RecordingError> {
        WRITES.fetch_add(1, Ordering::Relaxed);
        let time_ns = self.time_ns(due_ns);
        let header = MessageHeader { channel_id, sequence: 0, log_time: time_ns, publish_time: time_ns };
        self.bytes += message.len() as u64 + OVERHEAD_BYTES;
        let written = self.writer.write_to_known_channel(&header, &message);
        self.buffer = message;
        written.map_err(on(&self.path))
    }
}

/// Removes a recording that could not be completed, if no cycle can be read from it. Returns whether it did.
pub fn remove_if_empty(path: &Path) -> bool {
    let summary = Recording::open(path).and_then(|recording| recording.summary());
    matches!(summary, Err(RecordingError::Empty(_))) && fs::remove_file(path).is_ok()
}

fn channels(writer: &mut Writer<File>) -> Result<Channels, McapError> {
    let mut add = |topic: &str, (name, text): (&str, &str)| {
        let schema = writer.add_schema(name, "ros2msg", text.as_bytes())?;
        writer.add_channel(schema, topic, "cdr", &BTreeMap::new())
    };
    let [(cycle, cycle_text), (gap, gap_text)] =
        [&CycleMessage::LAYOUT, &GapMessage::LAYOUT].map(schema::of_layout);
    Ok(Channels {
        cycle: add(CYCLE, (&cycle, &cycle_text))?,
        memory: add(MEMORY, schema::MEMORY)?,
        gap: add(GAP, (&gap, &gap_text))?,
        frames: add(FRAMES, schema::FRAMES)?,
        joints: add(JOINTS, schema::JOINTS)?,
    })
}
